"""Let pixels without texture of their own follow the surface around them.

A pixel's trust is how well it matched. The plane through its trusted surroundings, sought in
growing rings until enough trust is found and never across a difference in grey, is tried in
its place; the photos decide, with a leaning towards the smooth plane only as strong as the
noise in the pixel's own correlation.
"""

from __future__ import annotations

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from garden_models.reconstruction.patch_cost import PatchCost, Planes
from garden_models.reconstruction.patchmatch import Matched, chosen
from garden_models.reconstruction.plane_fit import fit_planes

SPREADS = (1, 2, 4, 8)
NOISE_SPREADS = (1, 2, 4)
ENOUGH_TRUST = 3.0  # trust of about three perfectly matched pixels
COLOUR_SIGMA = 0.06  # grey difference at which a pixel's say in the plane falls to 1/e
SURE_TOLERANCE_PX = 0.5
UNSURE_TOLERANCE_PX = 4.0
SURE_SLACK = 0.01  # cost by which a smooth plane may be worse on rich texture
BARE_SLACK = 0.3  # and on a surface without any


def surrounding_planes(
    planes: Planes,
    trust: Float[Tensor, "h w"],
    grey: Float[Tensor, "h w"],
    step: Float[Tensor, "h w"],
) -> tuple[Planes, Bool[Tensor, "h w"]]:
    """Return the plane through each pixel's trusted surroundings and where there were enough.

    ``step`` is the inverse depth of one pixel of parallax; a pixel that trusts itself less
    looks at planes farther from its own.
    """
    unsure = UNSURE_TOLERANCE_PX * (1 - trust)
    tolerance = step * (SURE_TOLERANCE_PX + unsure)
    done = torch.zeros_like(trust, dtype=torch.bool)
    for spread in SPREADS:
        fitted, evidence = fit_planes(planes, grey, trust, tolerance, COLOUR_SIGMA, spread)
        use = ~done & (evidence >= ENOUGH_TRUST)
        planes = chosen(use, fitted, planes)
        done |= use
        if bool(done.all()):
            break
    return planes, done


def follow_surroundings(
    matched: Matched,
    patch_cost: PatchCost,
    grey: Float[Tensor, "h w"],
    step: Float[Tensor, "h w"],
    limits: tuple[float, float],
) -> Matched:
    """Take the surroundings' plane wherever the photos do not speak against it."""
    trust = (1 - matched.cost).clamp(0, 1) ** 2
    smooth, found = surrounding_planes(matched.planes, trust, grey, step)
    smooth = Planes(smooth.w.clamp(*limits), smooth.gx, smooth.gy)
    cost = patch_cost(smooth.flat()).view_as(matched.cost)
    bare = 1 - patch_cost.texture().view_as(cost)
    slack = SURE_SLACK + BARE_SLACK * bare
    take = found & (cost < matched.cost + slack)
    return Matched(chosen(take, smooth, matched.planes), torch.where(take, cost, matched.cost))


def average_out_noise(
    matched: Matched, grey: Float[Tensor, "h w"], step: Float[Tensor, "h w"]
) -> Matched:
    """Replace each plane by the one through its trusted surroundings that lie within half a
    pixel of parallax of it: finer than that, single matches are noise.
    """
    trust = (1 - matched.cost).clamp(0, 1) ** 2 + 1e-3
    planes = matched.planes
    for spread in NOISE_SPREADS:
        planes, _ = fit_planes(planes, grey, trust, SURE_TOLERANCE_PX * step, COLOUR_SIGMA, spread)
    return Matched(planes, matched.cost)
