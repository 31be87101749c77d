"""Estimate inverse depth and slope for every pixel of every photo, coarse to fine.

Quarter size: a plane sweep with semi-global smoothing finds the surface, PatchMatch turns
it into slanted planes. Half size: PatchMatch with each pixel's own best partners, held to what
the partners found (geometric consistency, Xu and Tao 2019). Full size: only pixels near depth
jumps are matched anew; everywhere else the plane is carried over and its depth refined.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Int
from torch import Tensor

from garden_models.reconstruction.dense_stereo import DenseStereo
from garden_models.reconstruction.depth_consistency import DepthView
from garden_models.reconstruction.depth_transfer import carry_planes
from garden_models.reconstruction.partner_atlas import PartnerAtlas, partner_atlas
from garden_models.reconstruction.patch_cost import PatchCost, PatchShape
from garden_models.reconstruction.patchmatch import (
    Matched,
    attempt,
    choose_views,
    propagate,
    refine_value,
    start,
    vary,
)
from garden_models.reconstruction.plane_fit import fit_planes, surface_planes
from garden_models.reconstruction.plane_smoothing import average_out_noise
from garden_models.reconstruction.plane_sweep import sweep_planes
from garden_models.reconstruction.planes import Planes, chosen, resize_planes
from garden_models.reconstruction.semi_global import semi_global
from garden_models.reconstruction.stereo_frame import StereoFrame, parallax_per_inverse_depth

COARSE_PATCH = PatchShape(radius=2, stride=1)
HALF_PATCH = PatchShape(radius=2, stride=1)
FULL_PATCH = PatchShape(radius=4, stride=2)
SWEEP_RADIUS = 1
REFINE_NOISE = 0.08  # see refine_value


@dataclass(frozen=True)
class ViewMatch:
    """One photo's planes at one level, their costs, and each pixel's chosen partners
    (indices into the photo's own list of partners).
    """

    matched: Matched
    views: Int[Tensor, "slots h w"]
    step: Float[Tensor, "h w"]
    """Inverse depth of one pixel of parallax, mean over the partners."""

    def trust(self, max_cost: float) -> Float[Tensor, "h w"]:
        """Return 1 - cost, 0 from ``max_cost`` on."""
        cost = self.matched.cost
        return (1 - cost).clamp(0, 1) * (cost < max_cost)

    @property
    def w(self) -> Float[Tensor, "h w"]:
        """Inverse depths."""
        return self.matched.planes.w


@torch.no_grad()
def sweep_view(
    frame: StereoFrame,
    partners: list[StereoFrame],
    limits: tuple[float, float],
    config: DenseStereo,
) -> Planes:
    """Find the surface of one photo from nothing but its depth range (``limits``: far, near
    inverse depth) at the coarse level.
    """
    middle = torch.full_like(frame.grey, sum(limits) / 2)
    parallax = float(parallax_per_inverse_depth(frame, partners, middle).mean())
    wanted = int((limits[1] - limits[0]) * parallax) + 2
    count = min(max(wanted, 32), config.max_planes)
    inverse_depths = torch.linspace(*limits, count, device=frame.grey.device)
    cost = sweep_planes(frame, partners, inverse_depths, SWEEP_RADIUS, config.best_partners)
    smooth = semi_global(cost, frame.grey, config.small_step, config.large_step, config.edge_scale)
    w = lowest_label(smooth, inverse_depths)
    tolerance = torch.full_like(w, float(inverse_depths[1] - inverse_depths[0]))
    even = torch.ones_like(w)
    return fit_planes(surface_planes(w), frame.grey, even, tolerance, 0.1, rounds=2)


def lowest_label(
    cost: Float[Tensor, "labels h w"], values: Float[Tensor, " labels"]
) -> Float[Tensor, "h w"]:
    """Return the value of the cheapest label, between labels by a parabola."""
    label = cost.argmin(dim=0).clamp(1, len(values) - 2)
    before, at, after = (cost.gather(0, (label + k)[None])[0] for k in (-1, 0, 1))
    shift = (before - after) / (2 * (before + after - 2 * at)).clamp(min=1e-6)
    return values[label] + shift.clamp(-0.5, 0.5) * (values[1] - values[0])


@torch.no_grad()
def coarse_match(
    frame: StereoFrame,
    partners: list[StereoFrame],
    planes: Planes,
    partner_w: list[Float[Tensor, "h w"]],
    limits: tuple[float, float],
    config: DenseStereo,
    generator: torch.Generator,
) -> ViewMatch:
    """Turn the sweep's surface into matched slanted planes; choose each pixel's partners."""
    atlas = partner_atlas(frame, partners, partner_w)
    patch_cost = PatchCost(frame, atlas, COARSE_PATCH, config.best_partners)
    step = 1 / parallax_per_inverse_depth(frame, partners, planes.w)
    matched = start(planes, patch_cost)
    for _ in range(2):
        matched = propagate(matched, patch_cost, limits)
        matched = vary(matched, patch_cost, limits, step, 0.3 * step, generator)
    return ViewMatch(matched, choose_views(patch_cost, matched.planes, config.best_partners), step)


@torch.no_grad()
def half_match(
    frame: StereoFrame,
    partners: list[StereoFrame],
    previous: ViewMatch,
    partner_w: list[Float[Tensor, "h w"]],
    limits: tuple[float, float],
    generator: torch.Generator,
) -> ViewMatch:
    """Match every pixel at half size, starting from the coarse planes."""
    planes = resize_planes(previous.matched.planes, frame.shape)
    views = resized_views(previous.views, frame.shape)
    atlas = partner_atlas(frame, partners, partner_w)
    patch_cost = views_cost(frame, atlas, HALF_PATCH, views)
    step = 1 / parallax_per_inverse_depth(frame, partners, planes.w)
    matched = start(planes, patch_cost)
    matched = propagate(matched, patch_cost, limits)
    matched = vary(matched, patch_cost, limits, step, 0.2 * step, generator)
    return ViewMatch(matched, views, step)


@torch.no_grad()
def half_rematch(
    frame: StereoFrame,
    partners: list[StereoFrame],
    previous: ViewMatch,
    partner_views: list[DepthView],
    limits: tuple[float, float],
) -> ViewMatch:
    """Match again at half size, now that every partner has slanted planes of its own to
    offer and to be held against.
    """
    atlas = partner_atlas(frame, partners, [view.planes.w for view in partner_views])
    patch_cost = views_cost(frame, atlas, HALF_PATCH, previous.views)
    matched = start(previous.matched.planes, patch_cost)
    carried, trust = carry_planes(frame, partner_views)
    offered = chosen(trust > 0, carried, matched.planes)
    matched = attempt(matched, offered, patch_cost, limits)
    matched = propagate(matched, patch_cost, limits)
    return ViewMatch(matched, previous.views, previous.step)


@torch.no_grad()
def full_match(
    frame: StereoFrame,
    partners: list[StereoFrame],
    previous: ViewMatch,
    limits: tuple[float, float],
) -> ViewMatch:
    """Sharpen depth jumps and refine every depth at full size, by the photos alone."""
    planes = resize_planes(previous.matched.planes, frame.shape)
    views = resized_views(previous.views, frame.shape)
    atlas = partner_atlas(frame, partners, None)
    everywhere = views_cost(frame, atlas, FULL_PATCH, views)
    step = 1 / parallax_per_inverse_depth(frame, partners, planes.w)
    matched = start(planes, everywhere)
    jumps = near_jumps(planes, step, radius=4)
    index = torch.nonzero(jumps.reshape(-1))[:, 0]
    if len(index):
        there = views_cost(frame, atlas, FULL_PATCH, views, index)
        matched = propagate(matched, there, limits)
    matched = refine_value(matched, everywhere, 0.5 * step, REFINE_NOISE)
    matched = average_out_noise(matched, frame.grey, step)
    return ViewMatch(matched, views, step)


def views_cost(
    frame: StereoFrame,
    atlas: PartnerAtlas,
    shape: PatchShape,
    views: Int[Tensor, "slots h w"],
    index: Int[Tensor, " n"] | None = None,
) -> PatchCost:
    """Return the patch cost with each pixel's own partners, at all or the indexed pixels."""
    flat = views.reshape(len(views), -1)
    chosen_views = flat if index is None else flat[:, index]
    return PatchCost(frame, atlas, shape, len(views), index=index, views=chosen_views)


def near_jumps(planes: Planes, step: Float[Tensor, "h w"], radius: int) -> Bool[Tensor, "h w"]:
    """Tell which pixels lie within ``radius`` of a place where the planes of two neighbours
    miss each other by more than a pixel of parallax (``step``: inverse depth of one).
    """
    right = planes.w[:, :-1] + planes.gx[:, :-1] - planes.w[:, 1:]
    below = planes.w[:-1] + planes.gy[:-1] - planes.w[1:]
    jump = torch.zeros_like(planes.w)
    jump[:, :-1] = torch.maximum(jump[:, :-1], (right.abs() > step[:, :-1]).float())
    jump[:-1] = torch.maximum(jump[:-1], (below.abs() > step[:-1]).float())
    size = 2 * radius + 1
    return F.max_pool2d(jump[None, None], size, 1, radius)[0, 0] > 0


def resized_views(
    views: Int[Tensor, "slots h w"], shape: tuple[int, int]
) -> Int[Tensor, "slots h2 w2"]:
    """Return the chosen partners at another level's size."""
    return F.interpolate(views[None].float(), shape, mode="nearest")[0].long()
