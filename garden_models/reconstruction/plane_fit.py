"""Fit a plane in inverse depth to every pixel's surroundings, without crossing edges."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor

from garden_models.reconstruction.planes import Planes, shifted


def start_slopes(w: Float[Tensor, "h w"]) -> tuple[Tensor, Tensor]:
    """Return one-sided differences along x and y: the flatter side, so that a jump on one
    side of a pixel does not tilt it.
    """
    after_x, before_x = shifted(w, 1, 0) - w, w - shifted(w, -1, 0)
    after_y, before_y = shifted(w, 0, 1) - w, w - shifted(w, 0, -1)
    gx = torch.where(after_x.abs() < before_x.abs(), after_x, before_x)
    gy = torch.where(after_y.abs() < before_y.abs(), after_y, before_y)
    return gx, gy


def fit_planes(
    planes: Planes,
    grey: Float[Tensor, "h w"],
    weight: Float[Tensor, "h w"],
    tolerance: Float[Tensor, "h w"],
    colour_sigma: float,
    spread: int = 1,
    rounds: int = 1,
) -> Planes:
    """Return, per pixel, the plane through the inverse depths of 5x5 pixels around it.

    The 25 pixels are ``spread`` apart. They count by ``weight`` (their own trust), by
    likeness of grey (``colour_sigma``) and by their distance from the current plane in units
    of ``tolerance`` (inverse depth), so that another surface does not bend the plane.
    """
    for _ in range(rounds):
        sums = _moments(planes, grey, weight, tolerance, colour_sigma, spread)
        planes = _solve(sums, planes)
    return planes


def plane_support(
    planes: Planes,
    grey: Float[Tensor, "h w"],
    weight: Float[Tensor, "h w"],
    tolerance: Float[Tensor, "h w"],
    colour_sigma: float,
    spread: int,
) -> tuple[Planes, Float[Tensor, "h w"], Float[Tensor, "h w"]]:
    """Fit once like ``fit_planes``; return also the sum of weights, and how far from the
    pixel the centre of what supports its plane lies.
    """
    sums = _moments(planes, grey, weight, tolerance, colour_sigma, spread)
    total = sums[0].clamp(min=1e-9)
    offset = torch.hypot(sums[1] / total, sums[2] / total)
    return _solve(sums, planes), sums[0], offset


def _moments(
    planes: Planes,
    grey: Tensor,
    weight: Tensor,
    tolerance: Tensor,
    colour_sigma: float,
    spread: int,
) -> Float[Tensor, "9 h w"]:
    height, width = grey.shape
    reach = 2 * spread
    stacked = torch.stack([planes.w, grey, weight])
    padded = F.pad(stacked[None], (reach,) * 4, mode="replicate")[0]
    padded[2] = F.pad(weight, (reach,) * 4)  # nothing beyond the border counts
    inverse_tolerance = 1 / tolerance
    sums = torch.zeros(9, height, width, device=grey.device)
    for dy in range(-reach, reach + 1, spread):
        for dx in range(-reach, reach + 1, spread):
            rows = slice(reach + dy, reach + dy + height)
            columns = slice(reach + dx, reach + dx + width)
            their_w, their_grey, their_weight = padded[:, rows, columns]
            residual = their_w - planes.w - planes.gx * dx - planes.gy * dy
            unlike = (their_grey - grey).abs().mul_(-1 / colour_sigma).exp_()
            far = (residual * inverse_tolerance).square_().add_(1)
            a = unlike.mul_(their_weight).div_(far.square_())
            ar = a * residual
            for k, factor in enumerate((1, dx, dy, dx * dx, dx * dy, dy * dy)):
                if factor:
                    sums[k].add_(a, alpha=factor)
            for k, factor in enumerate((1, dx, dy)):
                if factor:
                    sums[6 + k].add_(ar, alpha=factor)
    return sums


def _solve(sums: Float[Tensor, "9 h w"], planes: Planes) -> Planes:
    """Add the weighted least-squares correction to the planes (3x3 systems, Cramer)."""
    n, x, y, xx, xy, yy, r, rx, ry = sums
    ridge = 1e-3 * n + 1e-9  # keeps lone pixels at their current plane
    n, xx, yy = n + ridge, xx + ridge, yy + ridge
    c00, c01, c02 = xx * yy - xy * xy, xy * y - x * yy, x * xy - xx * y
    det = n * c00 + x * c01 + y * c02
    inverse = torch.where(det.abs() > 1e-12, det, torch.inf).reciprocal_()
    c11, c12, c22 = n * yy - y * y, x * y - n * xy, n * xx - x * x
    return Planes(
        planes.w + (c00 * r + c01 * rx + c02 * ry) * inverse,
        planes.gx + (c01 * r + c11 * rx + c12 * ry) * inverse,
        planes.gy + (c02 * r + c12 * rx + c22 * ry) * inverse,
    )


def surface_planes(w: Float[Tensor, "h w"]) -> Planes:
    """Return planes through single inverse depths with one-sided slopes."""
    gx, gy = start_slopes(w)
    return Planes(w, gx, gy)
