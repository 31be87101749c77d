"""Turn queries and keys by their positions (rotary encoding)."""

from __future__ import annotations

import torch
from torch import Tensor

BASE = 100.0
"""Ratio of the slowest to the fastest turn: scenes have tens of photos, not thousands."""


def rotate(values: Tensor, positions: Tensor) -> Tensor:
    """Return ``values`` (batch, heads, n, d) turned by ``positions`` (batch, n).

    Pairs of channels are turned by the position times a frequency of their own, so that the
    product of a query and a key depends on the difference of their positions only.
    """
    half = values.shape[-1] // 2
    place = torch.arange(half, device=values.device, dtype=values.dtype)
    angle = positions.to(values.dtype)[:, None, :, None] * BASE ** (-place / half)
    first, second = values[..., :half], values[..., half:]
    cosine, sine = angle.cos(), angle.sin()
    return torch.cat([first * cosine - second * sine, first * sine + second * cosine], dim=-1)
