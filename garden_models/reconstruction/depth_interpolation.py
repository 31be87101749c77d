"""Bridge bare patches of a surface whose surroundings carry it on.

A pixel without texture cannot be matched, but where confirmed depths of like colour lie on
all sides of it, on one plane, and the photos do not speak against it, that plane is the best
there is. Nothing is carried outward past the last confirmed depth, nor across an edge in the
photo, nor in front of what another photo sees. Such depths get little confidence.
"""

from __future__ import annotations

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from garden_models.reconstruction.depth_consistency import DepthView, at_level, each_seen
from garden_models.reconstruction.multiview_stereo import (
    HALF_PATCH,
    ViewMatch,
    resized_views,
    views_cost,
)
from garden_models.reconstruction.partner_atlas import partner_atlas
from garden_models.reconstruction.patch_cost import PatchCost
from garden_models.reconstruction.patchmatch import Matched, start
from garden_models.reconstruction.plane_fit import plane_support
from garden_models.reconstruction.planes import Planes, chosen, resize_planes, shifted
from garden_models.reconstruction.stereo_frame import StereoFrame, parallax_per_inverse_depth

REACH = 24  # steps from the nearest confirmed depth, in pixels of the level worked at
EDGE_STEPS = 200.0  # steps that a grey difference of 1 counts for: 5 % is ten pixels
SPREADS = (2, 4, 8)
TOLERANCE_PX = 1.0  # of parallax, within which surroundings lie on the plane
COLOUR_SIGMA = 0.04
ENOUGH_SUPPORT = 2.0  # confirmed pixels of full weight that a plane must rest on
MAX_OFFSET = 0.8  # of the spread: centre of the support, from the pixel
SURE_SLACK = 0.02  # cost by which the plane may be worse than the photo's own best match,
NOISE_SLACK = 0.3  # and more by this share of that match's own cost
INTERPOLATED_CONFIDENCE = 0.2


@torch.no_grad()
def bridge_gaps(
    view: DepthView,
    match: ViewMatch,
    small: StereoFrame,
    small_partners: list[StereoFrame],
    others: list[DepthView],
    max_relative: float,
    max_pixels: float,
) -> DepthView:
    """Return a view with its bare gaps bridged, worked out at the size of the small frame.

    ``match`` is the view's own matching result at full size.
    """
    views = resized_views(match.views, small.shape)
    atlas = partner_atlas(small, small_partners, None)
    patch_cost = views_cost(small, atlas, HALF_PATCH, views)
    own = resize_planes(match.matched.planes, small.shape)
    best = start(own, patch_cost)
    step = 1 / parallax_per_inverse_depth(small, small_partners, own.w)
    planes, found = interpolate(
        at_level(view, small), best, patch_cost, step, others, max_relative, max_pixels
    )
    full = at_level(DepthView(small, planes, found.float()), view.frame)
    gap = (view.trust <= 0) & (full.trust > 0)
    trust = torch.where(gap, INTERPOLATED_CONFIDENCE, view.trust)
    return DepthView(view.frame, chosen(gap, full.planes, view.planes), trust)


def interpolate(
    view: DepthView,
    matched: Matched,
    patch_cost: PatchCost,
    step: Float[Tensor, "h w"],
    others: list[DepthView],
    max_relative: float,
    max_pixels: float,
) -> tuple[Planes, Bool[Tensor, "h w"]]:
    """Return planes for bare gaps of a view and where they hold.

    ``view`` holds the confirmed depths (trust > 0), ``matched`` the photo's own best planes
    with their costs, confirmed or not; ``step`` is the inverse depth of one pixel of
    parallax; ``others`` are other photos' confirmed depths.
    """
    grey = view.frame.grey
    known = view.trust > 0
    planes, near = nearest_planes(view.planes, known, grey)
    planes, found = _supported(planes, known, grey, step)
    found &= near & ~known & (planes.w > 0)
    if not bool(found.any()):
        return planes, found
    cost = patch_cost(planes.flat()).view_as(grey)
    found &= cost < (1 + NOISE_SLACK) * matched.cost + SURE_SLACK
    through = torch.zeros_like(found)
    candidate = DepthView(view.frame, planes, found.float())
    for seen in each_seen(candidate, others, max_relative, max_pixels):
        through |= seen.through.view_as(found)
    return planes, found & ~through


def nearest_planes(
    planes: Planes, known: Bool[Tensor, "h w"], grey: Float[Tensor, "h w"]
) -> tuple[Planes, Bool[Tensor, "h w"]]:
    """Carry known planes outward, around edges in the photo rather than across them.

    Returns the plane of each pixel's nearest known one (path length plus grey climbed) and
    where one is within ``REACH``.
    """
    distance = torch.where(known, 0.0, torch.inf)
    for _ in range(REACH):
        before = distance
        for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            climb = (shifted(grey, dx, dy) - grey).abs()
            theirs = shifted(distance, dx, dy) + 1 + EDGE_STEPS * climb
            closer = theirs < distance
            gx, gy = shifted(planes.gx, dx, dy), shifted(planes.gy, dx, dy)
            extended = Planes(shifted(planes.w, dx, dy) - gx * dx - gy * dy, gx, gy)
            planes = chosen(closer, extended, planes)
            distance = torch.where(closer, theirs, distance)
        if torch.equal(before, distance):
            break
    return planes, distance <= REACH


def _supported(
    planes: Planes,
    known: Bool[Tensor, "h w"],
    grey: Float[Tensor, "h w"],
    step: Float[Tensor, "h w"],
) -> tuple[Planes, Bool[Tensor, "h w"]]:
    """Refit planes to the known depths around and tell which these surround."""
    found = torch.zeros_like(known)
    weight = known.float()
    for spread in SPREADS:
        fitted, support, offset = plane_support(
            planes, grey, weight, TOLERANCE_PX * step, COLOUR_SIGMA, spread
        )
        take = ~found & (support >= ENOUGH_SUPPORT) & (offset <= MAX_OFFSET * spread)
        planes = chosen(take, fitted, planes)
        found |= take
    return planes, found
