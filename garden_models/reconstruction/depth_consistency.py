"""Check each photo's depths against the depths that other photos found for the same spots."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from garden_models.reconstruction.planes import Planes, resize_planes
from garden_models.reconstruction.stereo_frame import (
    StereoFrame,
    homogeneous_pixels,
    pair_geometry,
)


@dataclass(frozen=True)
class DepthView:
    """One photo's frame and planes; pixels of ``trust`` 0 have no say."""

    frame: StereoFrame
    planes: Planes
    trust: Float[Tensor, "h w"]


def at_level(view: DepthView, frame: StereoFrame) -> DepthView:
    """Return a view's planes and trust at the size of another level's frame."""
    height, width = frame.shape
    rows, columns = view.frame.shape
    device = view.trust.device
    y = ((torch.arange(height, device=device) + 0.5) * (rows / height)).long()
    x = ((torch.arange(width, device=device) + 0.5) * (columns / width)).long()
    return DepthView(frame, resize_planes(view.planes, frame.shape), view.trust[y][:, x])


@dataclass(frozen=True)
class Agreement:
    """What the other photos say of one photo's inverse depths.

    ``count`` photos agree; ``mean_w`` is the trust-weighted mean inverse depth of the photo
    itself and those that agree; ``free`` photos look through the spot at something behind it,
    which contradicts it.
    """

    count: Float[Tensor, "h w"]
    mean_w: Float[Tensor, "h w"]
    free: Float[Tensor, "h w"]


@dataclass(frozen=True)
class Seen:
    """How another photo sees each pixel of the reference (vectors over its pixels).

    ``index`` is the other photo's flat pixel; ``carried`` its inverse depth there, expressed
    in the reference photo; ``agrees`` and ``through`` (it sees farther) are exclusive.
    """

    index: Int[Tensor, " n"]
    carried: Float[Tensor, " n"]
    trust: Float[Tensor, " n"]
    agrees: Bool[Tensor, " n"]
    through: Bool[Tensor, " n"]


def see_from(
    reference: StereoFrame,
    w: Float[Tensor, " n"],
    pixels: Float[Tensor, "3 n"],
    other: DepthView,
    max_relative: float,
    max_pixels: float,
) -> Seen:
    """Look at the reference's points from another photo.

    The other's plane is evaluated at the exact spot where it sees the point, so that coarse
    pixels on slanted surfaces agree too.
    """
    frame = other.frame
    pair = pair_geometry(reference, frame)
    x, y, z = pair.A @ pixels + pair.b[:, None] * w
    visible = z > 1e-6
    z = torch.where(visible, z, 1.0)
    x, y = x / z, y / z
    height, width = frame.shape
    visible &= (x >= 0) & (x < width) & (y >= 0) & (y < height)
    column, row = x.long().clamp_(0, width - 1), y.long().clamp_(0, height - 1)
    index = row * width + column
    theirs = other.planes.at(index)
    trust = other.trust.reshape(-1)[index]
    seen = theirs.w + theirs.gx * (x - column - 0.5) + theirs.gy * (y - row - 0.5)
    visible &= (trust > 0) & (seen > 0)
    # z is relative depth a + b2 w along the ray; seen = carried / (a + b2 carried)
    denominator = 1 - seen * pair.b[2]
    safe = torch.where(denominator.abs() > 1e-6, denominator, 1.0)
    carried = seen * (z - pair.b[2] * w) / safe
    motion_x = (pair.b[0] - x * pair.b[2]) / z
    motion_y = (pair.b[1] - y * pair.b[2]) / z
    error_px = (carried - w).abs() * torch.hypot(motion_x, motion_y)
    relative = (carried - w) / w
    agrees = visible & (relative.abs() < max_relative) & (error_px < max_pixels)
    through = visible & (relative < -3 * max_relative) & (error_px > 2 * max_pixels)
    return Seen(index, carried, trust, agrees, through)


def each_seen(
    reference: DepthView, others: list[DepthView], max_relative: float, max_pixels: float
) -> Iterator[Seen]:
    """Yield how each other photo sees the reference's pixels."""
    height, width = reference.frame.shape
    w = reference.planes.w.reshape(-1)
    pixels = homogeneous_pixels(height, width, w.device).reshape(3, -1)
    for other in others:
        yield see_from(reference.frame, w, pixels, other, max_relative, max_pixels)


@torch.no_grad()
def agreement(
    reference: DepthView, others: list[DepthView], max_relative: float, max_pixels: float
) -> Agreement:
    """Count the photos that find the same depth within ``max_relative`` (a share of it) and
    within ``max_pixels`` of parallax, and average with them.
    """
    w = reference.planes.w.reshape(-1)
    count, free = torch.zeros_like(w), torch.zeros_like(w)
    weight = reference.trust.reshape(-1) + 1e-6
    total = weight * w
    for seen in each_seen(reference, others, max_relative, max_pixels):
        count += seen.agrees
        free += seen.through
        say = seen.trust * seen.agrees
        weight = weight + say
        total += say * seen.carried
    shape = reference.frame.shape
    return Agreement(count.view(shape), (total / weight).view(shape), free.view(shape))
