"""Score inverse depths by sweeping fronto-parallel planes through all partners at once.

Collins (1996) with normalised cross-correlation over a box window. The noise floor in the
correlation makes bare surfaces score 0 at every depth instead of matching noise.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor

from garden_models.reconstruction.stereo_frame import (
    PairGeometry,
    StereoFrame,
    homogeneous_pixels,
    pair_geometry,
)

NOISE_VARIANCE = (1.0 / 255.0) ** 2  # of a shrunk 8-bit photo, grey in 0..1
PLANES_AT_ONCE = 8


def box_mean(images: Float[Tensor, "*b h w"], radius: int) -> Float[Tensor, "*b h w"]:
    """Return the mean over (2 radius + 1)^2 windows; the border repeats its edge."""
    height, width = images.shape[-2:]
    flat = images.reshape(1, -1, height, width)
    padded = F.pad(flat, (radius, radius, radius, radius), mode="replicate")
    rows = padded[..., 0:width].clone()
    for shift in range(1, 2 * radius + 1):
        rows += padded[..., shift : shift + width]
    out = rows[..., 0:height, :].clone()
    for shift in range(1, 2 * radius + 1):
        out += rows[..., shift : shift + height, :]
    return out.mul_(1.0 / (2 * radius + 1) ** 2).reshape(images.shape)


def sweep_planes(
    reference: StereoFrame,
    partners: list[StereoFrame],
    inverse_depths: Float[Tensor, " planes"],
    radius: int,
    best: int,
) -> Float[Tensor, "planes h w"]:
    """Return matching costs in 0..1 (1 - correlation, cut at 1; 1 = no evidence).

    A pixel's cost is the mean over its ``best`` partners, so that one that is hidden or out
    of frame in some photos is still measured by the others.
    """
    height, width = reference.shape
    pixels = homogeneous_pixels(height, width, reference.grey.device)
    mean = box_mean(reference.grey, radius)
    variance = box_mean(reference.grey**2, radius) - mean**2 + NOISE_VARIANCE
    pairs = [pair_geometry(reference, partner) for partner in partners]
    best = min(best, len(partners))
    cost = torch.empty(len(inverse_depths), height, width, device=reference.grey.device)
    for start in range(0, len(inverse_depths), PLANES_AT_ONCE):
        planes = inverse_depths[start : start + PLANES_AT_ONCE]
        per_partner = torch.stack(
            [
                _partner_cost(reference.grey, mean, variance, pixels, partner, pair, planes, radius)
                for partner, pair in zip(partners, pairs, strict=True)
            ]
        )
        lowest = (
            per_partner.topk(best, dim=0, largest=False).values
            if best < len(partners)
            else per_partner
        )
        cost[start : start + len(planes)] = lowest.mean(dim=0)
    return cost


def _partner_cost(
    grey: Float[Tensor, "h w"],
    mean: Float[Tensor, "h w"],
    variance: Float[Tensor, "h w"],
    pixels: Float[Tensor, "3 h w"],
    partner: StereoFrame,
    pair: PairGeometry,
    planes: Float[Tensor, " d"],
    radius: int,
) -> Float[Tensor, "d h w"]:
    warped, inside = _warp(pixels, partner, pair, planes)
    warped_mean = box_mean(warped, radius)
    warped_variance = box_mean(warped * warped, radius).sub_(warped_mean**2).add_(NOISE_VARIANCE)
    covariance = box_mean(warped * grey, radius).sub_(warped_mean * mean)
    correlation = covariance.mul_(torch.rsqrt(warped_variance.clamp_(min=1e-8) * variance))
    return torch.where(inside, (1 - correlation).clamp_(0, 1), 1.0)


def _warp(
    pixels: Float[Tensor, "3 h w"],
    partner: StereoFrame,
    pair: PairGeometry,
    planes: Float[Tensor, " d"],
) -> tuple[Float[Tensor, "d h w"], Tensor]:
    height, width = partner.shape
    base = torch.einsum("ij,jhw->ihw", pair.A, pixels)
    x, y, z = (base[i] + pair.b[i] * planes[:, None, None] for i in range(3))
    behind = z <= 1e-6
    scale = 2.0 / z.masked_fill_(behind, -1e-3)
    grid = torch.stack([x * scale / width - 1, y * scale / height - 1], dim=-1)
    inside = (grid.abs() < 1).all(dim=-1) & ~behind
    source = partner.grey.expand(len(planes), 1, height, width)
    warped = F.grid_sample(source, grid, padding_mode="border", align_corners=False)
    return warped[:, 0], inside
