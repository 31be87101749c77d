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
    w: Float[Tensor, "h w"],
    grey: Float[Tensor, "h w"],
    weight: Float[Tensor, "h w"],
    tolerance: Float[Tensor, "h w"],
    radius: int,
    colour_sigma: float,
    rounds: int = 2,
) -> Planes:
    """Return, per pixel, the plane through its window's inverse depths.

    Neighbours count by ``weight`` (their own trust), by likeness of grey (``colour_sigma``)
    and by their distance from the current plane in units of ``tolerance`` (inverse depth),
    so that another surface in the window does not bend the plane.
    """
    gx, gy = start_slopes(w)
    value = w
    for _ in range(rounds):
        sums = _moments(w, grey, weight, tolerance, radius, colour_sigma, value, gx, gy)
        value, gx, gy = _solve(sums, value, gx, gy)
    return Planes(value, gx, gy)


def _moments(
    w: Tensor,
    grey: Tensor,
    weight: Tensor,
    tolerance: Tensor,
    radius: int,
    colour_sigma: float,
    value: Tensor,
    gx: Tensor,
    gy: Tensor,
) -> list[Tensor]:
    height, width = w.shape
    stacked = torch.stack([w, grey, weight])
    padded = F.pad(stacked[None], (radius,) * 4, mode="replicate")[0]
    inside = F.pad(torch.ones_like(w), (radius,) * 4)
    sums = [torch.zeros_like(w) for _ in range(9)]
    for dy in range(-radius, radius + 1):
        for dx in range(-radius, radius + 1):
            rows = slice(radius + dy, radius + dy + height)
            columns = slice(radius + dx, radius + dx + width)
            their_w, their_grey, their_weight = padded[:, rows, columns]
            residual = their_w - (value + gx * dx + gy * dy)
            a = their_weight * inside[rows, columns]
            a = a * torch.exp(-(their_grey - grey).abs() / colour_sigma)
            a = a / (1 + (residual / tolerance) ** 2) ** 2
            terms = (a, a * dx, a * dy, a * (dx * dx), a * (dx * dy), a * (dy * dy))
            for index, term in enumerate(terms):
                sums[index] += term
            ar = a * residual
            sums[6] += ar
            sums[7] += ar * dx
            sums[8] += ar * dy
    return sums


def _solve(
    sums: list[Tensor], value: Tensor, gx: Tensor, gy: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """Add the weighted least-squares correction to the planes (3x3 systems, Cramer)."""
    n, x, y, xx, xy, yy, r, rx, ry = sums
    ridge = 1e-3 * n + 1e-9  # keeps lone pixels at their current plane
    n, xx, yy = n + ridge, xx + ridge, yy + ridge
    c00, c01, c02 = xx * yy - xy * xy, xy * y - x * yy, x * xy - xx * y
    det = n * c00 + x * c01 + y * c02
    safe = det.abs() > 1e-12
    inverse = torch.where(safe, 1.0 / torch.where(safe, det, torch.ones_like(det)), 0.0)
    c11, c12, c22 = n * yy - y * y, x * y - n * xy, n * xx - x * x
    d_value = (c00 * r + c01 * rx + c02 * ry) * inverse
    d_gx = (c01 * r + c11 * rx + c12 * ry) * inverse
    d_gy = (c02 * r + c12 * rx + c22 * ry) * inverse
    return value + d_value, gx + d_gx, gy + d_gy


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
