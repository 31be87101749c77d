"""Improve plane hypotheses per pixel: take over neighbours' planes, then vary one's own.

PatchMatch stereo (Bleyer et al. 2011) with all pixels updated at once and, per direction,
only the neighbour that matches best tried (Xu and Tao 2019), which suits array code.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from jaxtyping import Float, Int
from torch import Tensor

from garden_models.reconstruction.patch_cost import PatchCost
from garden_models.reconstruction.planes import Planes, chosen, shifted

DIRECTIONS: tuple[tuple[tuple[int, int], ...], ...] = (
    ((-1, 0), (-3, 0), (-5, -1), (-5, 1)),
    ((1, 0), (3, 0), (5, -1), (5, 1)),
    ((0, -1), (0, -3), (-1, -5), (1, -5)),
    ((0, 1), (0, 3), (-1, 5), (1, 5)),
)
"""Offsets (dx, dy) of the neighbours considered, by direction."""


@dataclass(frozen=True)
class Matched:
    """Each pixel's best plane so far and its cost, as images."""

    planes: Planes
    cost: Float[Tensor, "h w"]


def neighbour_planes(matched: Matched, direction: tuple[tuple[int, int], ...]) -> Planes:
    """Return, at each pixel, the plane of its cheapest neighbour in a direction, extended
    to the pixel.
    """
    planes = matched.planes
    best = torch.full_like(matched.cost, torch.inf)
    w, gx, gy = planes.w, planes.gx, planes.gy
    for dx, dy in direction:
        their_cost = shifted(matched.cost, dx, dy)
        their_gx, their_gy = shifted(planes.gx, dx, dy), shifted(planes.gy, dx, dy)
        better = their_cost < best
        best = torch.where(better, their_cost, best)
        extended = shifted(planes.w, dx, dy) - their_gx * dx - their_gy * dy
        w = torch.where(better, extended, w)
        gx = torch.where(better, their_gx, gx)
        gy = torch.where(better, their_gy, gy)
    return Planes(w, gx, gy)


def start(planes: Planes, patch_cost: PatchCost) -> Matched:
    """Cost the planes that a level starts from (all pixels)."""
    return Matched(planes, patch_cost(planes.flat()).view_as(planes.w))


def attempt(
    matched: Matched, rival: Planes, patch_cost: PatchCost, limits: tuple[float, float]
) -> Matched:
    """Keep, per pixel that ``patch_cost`` covers, the cheaper of two planes.

    ``rival`` is whole images; values outside ``limits`` (far, near inverse depth) are moved
    to the limit.
    """
    rival = Planes(rival.w.clamp(*limits), rival.gx, rival.gy)
    index = patch_cost.index
    if index is None:
        cost = patch_cost(rival.flat()).view_as(matched.cost)
    else:
        cost = torch.full_like(matched.cost, torch.inf)
        cost.view(-1)[index] = patch_cost(rival.at(index))
    kept = chosen(cost < matched.cost, rival, matched.planes)
    return Matched(kept, torch.minimum(cost, matched.cost))


def propagate(matched: Matched, patch_cost: PatchCost, limits: tuple[float, float]) -> Matched:
    """Try the best neighbour's plane of each direction."""
    for direction in DIRECTIONS:
        matched = attempt(matched, neighbour_planes(matched, direction), patch_cost, limits)
    return matched


def vary(
    matched: Matched,
    patch_cost: PatchCost,
    limits: tuple[float, float],
    step_w: Float[Tensor, "h w"],
    step_slope: Float[Tensor, "h w"],
    generator: torch.Generator,
) -> Matched:
    """Try one random change of value and slopes within the given steps."""
    planes = matched.planes
    noise = torch.rand((3, *planes.w.shape), generator=generator) * 2 - 1
    noise = noise.to(planes.w.device)
    rival = Planes(
        planes.w + noise[0] * step_w,
        planes.gx + noise[1] * step_slope,
        planes.gy + noise[2] * step_slope,
    )
    return attempt(matched, rival, patch_cost, limits)


def refine_value(
    matched: Matched, patch_cost: PatchCost, step_w: Float[Tensor, "h w"], noise: float
) -> Matched:
    """Move each value to the lowest point of the parabola through three costs.

    The parabola is stiffened by ``noise`` times the cost at hand, which is about the share of
    the patch that is noise, so that bare and blurred surfaces stay where they are instead of
    following it.
    """
    planes = matched.planes
    lower = patch_cost(Planes(planes.w - step_w, planes.gx, planes.gy).flat())
    upper = patch_cost(Planes(planes.w + step_w, planes.gx, planes.gy).flat())
    cost = matched.cost.reshape(-1)
    bend = (lower + upper - 2 * cost).clamp(min=0) + noise * cost.clamp(max=1) + 1e-6
    shift = ((lower - upper) / (2 * bend)).clamp(-1.0, 1.0).view_as(planes.w)
    lowest = torch.minimum(torch.minimum(lower, upper), cost).view_as(planes.w)
    return Matched(Planes(planes.w + shift * step_w, planes.gx, planes.gy), lowest)


def choose_views(patch_cost: PatchCost, planes: Planes, count: int) -> Int[Tensor, "slots h w"]:
    """Return each pixel's ``count`` best partners, judged over its 3x3 surroundings."""
    shape = planes.w.shape
    costs = patch_cost.per_view(planes.flat()).view(-1, *shape)
    costs = F.avg_pool2d(costs[None], 3, 1, 1, count_include_pad=False)[0]
    return costs.topk(min(count, len(costs)), dim=0, largest=False).indices
