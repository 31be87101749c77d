"""Fit a plane in inverse depth to every pixel's surroundings, without crossing edges."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor

from garden_models.reconstruction.patch_cost import Planes
from garden_models.reconstruction.patchmatch import shifted


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
) -> tuple[Planes, Float[Tensor, "h w"]]:
    """Return, per pixel, the plane through the inverse depths of 5x5 pixels around it, and
    how much evidence it rests on (sum of weights).

    The 25 pixels are ``spread`` apart. They count by ``weight`` (their own trust), by
    likeness of grey (``colour_sigma``) and by their distance from the current plane in units
    of ``tolerance`` (inverse depth), so that another surface does not bend the plane.
    """
    evidence = weight
    for _ in range(rounds):
        sums = _moments(planes, grey, weight, tolerance, colour_sigma, spread)
        planes, evidence = _solve(sums, planes), sums[0]
    return planes, evidence


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


def resize_planes(planes: Planes, size: tuple[int, int]) -> Planes:
    """Carry planes to another resolution (height, width): each new pixel takes its nearest
    old pixel's plane, evaluated where the new pixel is.
    """
    height, width = size
    old_height, old_width = planes.w.shape
    device = planes.w.device
    y = (torch.arange(height, device=device) + 0.5) * (old_height / height)
    x = (torch.arange(width, device=device) + 0.5) * (old_width / width)
    row, column = y.long().clamp(max=old_height - 1), x.long().clamp(max=old_width - 1)
    dy, dx = (y - row - 0.5)[:, None], (x - column - 0.5)[None, :]

    def pick(field: Tensor) -> Tensor:
        return field[row][:, column]

    gx, gy = pick(planes.gx), pick(planes.gy)
    w = pick(planes.w) + gx * dx + gy * dy
    return Planes(w, gx * (old_width / width), gy * (old_height / height))
