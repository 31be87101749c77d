"""Carry the planes that one photo found into another photo's image."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor

from garden_models.reconstruction.depth_consistency import DepthView
from garden_models.reconstruction.planes import Planes
from garden_models.reconstruction.stereo_frame import (
    StereoFrame,
    homogeneous_pixels,
    pair_geometry,
)


def transformed_planes(
    coefficients: Float[Tensor, "3 n"], A: Float[Tensor, "3 3"], b: Float[Tensor, "3"]
) -> Float[Tensor, "3 n"]:
    """Return plane coefficients in another photo.

    A plane w = c . (x, y, 1) maps pixels by ``H = A + b c^T`` and becomes ``H^-T c``, which
    Sherman and Morrison shorten to ``A^-T c / (1 + c . A^-1 b)``.
    """
    inverse = torch.linalg.inv(A.double()).float()
    scale = 1 + (inverse @ b) @ coefficients
    safe = torch.where(scale.abs() > 1e-6, scale, torch.inf)
    return (inverse.T @ coefficients) / safe


def carry_planes(
    target: StereoFrame, sources: list[DepthView]
) -> tuple[Planes, Float[Tensor, "h w"]]:
    """Return the nearest surface that the sources' trusted pixels put at each pixel of the
    target, and their trust (0 where they put none).

    Single missing pixels are filled from their neighbours' planes.
    """
    height, width = target.shape
    device = target.grey.device
    best = torch.zeros(height * width, device=device)
    found = torch.zeros(3, height * width, device=device)
    trust = torch.zeros(height * width, device=device)
    for source in sources:
        index, planes, say = _land(target, source)
        w = planes[0] * (index % width + 0.5) + planes[1] * (index // width + 0.5) + planes[2]
        nearest = best.scatter_reduce(0, index, w, reduce="amax", include_self=True)
        wins = w >= nearest[index]
        won = index[wins]
        best = nearest
        found[:, won] = planes[:, wins]
        trust[won] = say[wins]
    return _fill_gaps(found.view(3, height, width), trust.view(height, width))


def _land(target: StereoFrame, source: DepthView) -> tuple[Tensor, Tensor, Tensor]:
    """Return target pixels, plane coefficients there and trust of one source's pixels."""
    height, width = source.frame.shape
    pixels = homogeneous_pixels(height, width, target.grey.device).reshape(3, -1)
    trust = source.trust.reshape(-1)
    use = torch.nonzero(trust > 0)[:, 0]
    planes, pixels, trust = source.planes.at(use), pixels[:, use], trust[use]
    pair = pair_geometry(source.frame, target)
    x, y, z = pair.A @ pixels + pair.b[:, None] * planes.w
    front = z > 1e-6
    z = torch.where(front, z, 1.0)
    column, row = (x / z).floor().long(), (y / z).floor().long()
    rows, columns = target.shape
    lands = front & (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    constant = planes.w - planes.gx * pixels[0] - planes.gy * pixels[1]
    coefficients = torch.stack([planes.gx, planes.gy, constant])[:, lands]
    index = (row * columns + column)[lands]
    return index, transformed_planes(coefficients, pair.A, pair.b), trust[lands]


def _fill_gaps(
    found: Float[Tensor, "3 h w"], trust: Float[Tensor, "h w"]
) -> tuple[Planes, Float[Tensor, "h w"]]:
    height, width = trust.shape
    have = (trust > 0).float()
    total = F.avg_pool2d(torch.cat([found * have, have[None], (trust * have)[None]])[None], 3, 1, 1)
    share = total[0, 3]
    filled = total[0, :3] / share.clamp(min=1e-6)
    gap = (have == 0) & (share >= 3.9 / 9)
    planes = torch.where(gap, filled, found)
    trust = torch.where(gap, total[0, 4] / share.clamp(min=1e-6), trust)
    x, y, _ = homogeneous_pixels(height, width, trust.device)
    return Planes(planes[0] * x + planes[1] * y + planes[2], planes[0], planes[1]), trust
