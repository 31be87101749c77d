"""Write depth maps, masks and colour pictures as PNG."""

from __future__ import annotations

import io

import numpy as np
from jaxtyping import Bool, Float, UInt8
from PIL import Image

DEPTH_UNIT_M = 0.001
"""Depth PNGs are 16-bit millimetres; 0 means no depth."""


def depth_png(depth: Float[np.ndarray, "h w"]) -> bytes:
    """Return a 16-bit PNG in millimetres; what does not fit in 65.5 m becomes 0."""
    millimetres = np.round(depth / DEPTH_UNIT_M)
    millimetres = np.where(np.isfinite(millimetres) & (millimetres <= 65535), millimetres, 0)
    return _png(Image.fromarray(millimetres.astype(np.uint16)))


def mask_png(mask: Bool[np.ndarray, "h w"]) -> bytes:
    """Return a one-bit PNG."""
    return _png(Image.fromarray(mask))


def rgb_png(rgb: UInt8[np.ndarray, "h w 3"]) -> bytes:
    """Return a 24-bit PNG without a colour profile; the first row is the top."""
    return _png(Image.fromarray(rgb))


def _png(image: Image.Image) -> bytes:
    stream = io.BytesIO()
    image.save(stream, "PNG", optimize=False, compress_level=4)
    return stream.getvalue()
