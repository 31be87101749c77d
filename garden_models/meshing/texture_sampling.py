"""Look colours up in a texture."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, UInt8


def sample_texture(
    texture: UInt8[np.ndarray, "h w 3"], uv: Float[np.ndarray, "n 2"]
) -> UInt8[np.ndarray, "n 3"]:
    """Return the colours at ``uv`` (0..1, origin at the lower left), blended bilinearly.

    Coordinates outside of 0..1 wrap around.
    """
    height, width = texture.shape[:2]
    inside = uv - np.floor(uv)
    inside = np.where((inside == 0) & (uv > 0), 1.0, inside)
    x = np.clip(inside[:, 0] * width - 0.5, 0, width - 1)
    y = np.clip((1.0 - inside[:, 1]) * height - 0.5, 0, height - 1)
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)
    right, below = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
    across, down = (x - left)[:, None], (y - top)[:, None]
    picture = texture.astype(np.float64)
    upper = picture[top, left] * (1 - across) + picture[top, right] * across
    lower = picture[below, left] * (1 - across) + picture[below, right] * across
    return np.rint(upper * (1 - down) + lower * down).astype(np.uint8)
