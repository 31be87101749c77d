"""Turn arrays into pictures that stand inside the page."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from html import escape

import numpy as np
from jaxtyping import Bool, Float, UInt8
from PIL import Image

Picture = UInt8[np.ndarray, "h w 3"]


def data_uri(rgb: Picture, long_side: int = 480, quality: int = 82) -> str:
    """Return a JPEG data URI of the picture, scaled down to ``long_side``."""
    image = Image.fromarray(rgb)
    if max(image.size) > long_side:
        image.thumbnail((long_side, long_side), Image.Resampling.LANCZOS)
    stream = io.BytesIO()
    image.save(stream, "JPEG", quality=quality)
    return "data:image/jpeg;base64," + base64.b64encode(stream.getvalue()).decode()


def figure(rgb: Picture, caption: str, alt: str = "", long_side: int = 480) -> str:
    """Return the picture with its caption; ``alt`` says what it shows to who cannot see it."""
    width, height = rgb.shape[1], rgb.shape[0]
    return (
        f'<figure><img loading="lazy" width="{width}" height="{height}" '
        f'src="{data_uri(rgb, long_side)}" alt="{escape(alt or caption)}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


def cropped(pictures: Sequence[Picture], backdrop: tuple[int, int, int]) -> list[Picture]:
    """Cut from all pictures alike the rows and columns where none shows more than backdrop.

    What is cut is the same on opposite sides, so that the middle stays in the middle.
    """
    drawn = np.any(
        [(picture != np.array(backdrop, np.uint8)).any(axis=2) for picture in pictures], axis=0
    )
    rows, columns = (_middle(drawn.any(axis=axis)) for axis in (1, 0))
    return [np.ascontiguousarray(picture[rows, columns]) for picture in pictures]


def _middle(used: Bool[np.ndarray, " n"], border: int = 4) -> slice:
    """Return the narrowest range about the middle that holds all that is used."""
    index = np.flatnonzero(used)
    if not len(index):
        return slice(0, len(used))
    free = max(0, int(min(index[0], len(used) - 1 - index[-1])) - border)
    return slice(free, len(used) - free)


def depth_picture(depth: Float[np.ndarray, "h w"]) -> tuple[Picture, tuple[float, float] | None]:
    """Colour a depth map by inverse depth, near is warm; pixels without depth are grey.

    Also returns the depths (nearest, farthest) that the colours span, None without any.
    """
    import cv2

    valid = depth > 0
    if not valid.any():
        return np.full((*depth.shape, 3), 60, np.uint8), None
    inverse = np.where(valid, 1.0 / np.where(valid, depth, 1.0), 0.0)
    low, high = (float(level) for level in np.percentile(inverse[valid], [2, 98]))
    level = np.clip((inverse - low) / max(high - low, 1e-9), 0, 1)
    coloured = cv2.applyColorMap((level * 255).astype(np.uint8), cv2.COLORMAP_TURBO)
    coloured[~valid] = 60
    return np.ascontiguousarray(coloured[..., ::-1]), (1 / high, 1 / low)


def mask_overlay(
    rgb: Picture, mask: Bool[np.ndarray, "h w"], colour: tuple[int, int, int] = (255, 90, 30)
) -> Picture:
    """Dim the picture outside the mask and draw the mask's outline."""
    import cv2

    out = rgb.copy()
    out[~mask] = (0.45 * out[~mask]).astype(np.uint8)
    contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(out, contours, -1, colour, 2)
    return out


def draw_box(
    rgb: Picture,
    box: tuple[float, float, float, float],
    colour: tuple[int, int, int] = (255, 90, 30),
) -> Picture:
    """Draw a target's box (pixels of ``rgb``)."""
    import cv2

    x0, y0, x1, y1 = (round(v) for v in box)
    out = np.ascontiguousarray(rgb)
    cv2.rectangle(out, (x0, y0), (x1, y1), colour, 2)
    return out
