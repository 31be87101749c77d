"""Convert boxes between the photo's pixels and the way in which a model writes them.

Every model counts in its own way, and says so nowhere in its answer: order of the axes,
thousandths or pixels, pixels of which image. The table is by family of models.
"""

from __future__ import annotations

import math
import re
from typing import Literal, get_args

BoxConvention = Literal["yxyx_1000", "xyxy_1000", "xyxy_px_resized", "xyxy_px", "xyxy_unit"]
"""``yxyx_1000`` is (top, left, bottom, right), the others (left, top, right, bottom);
thousandths of height and width, pixels of the image as the model's own preprocessing
resizes it, pixels of the image that is sent, or shares (0..1).
"""

CONVENTIONS: tuple[BoxConvention, ...] = get_args(BoxConvention)
Box = tuple[float, float, float, float]
Size = tuple[int, int]
"""(width, height) in pixels."""

SIDE_MULTIPLE = 28
PIXEL_RANGE = (56 * 56, 14 * 14 * 4 * 1280)
"""Of Qwen2.5-VL's own resizing; ``photo_side`` keeps what is sent within it."""

_ORDER = {
    "yxyx_1000": "[top, left, bottom, right]",
    "xyxy_1000": "[left, top, right, bottom]",
    "xyxy_px_resized": "[left, top, right, bottom]",
    "xyxy_px": "[left, top, right, bottom]",
    "xyxy_unit": "[left, top, right, bottom]",
}


def convention_of(model: str) -> BoxConvention | None:
    """Return how the models of a family write boxes, None if it is not known."""
    name = model.lower().rpartition("/")[2]
    if name.startswith(("gemini", "gemma")):
        return "yxyx_1000"
    qwen = re.match(r"qwen-?(\d+(?:\.\d+)?)", name)
    if qwen is None:
        return None
    version = float(qwen.group(1))
    return "xyxy_px_resized" if 2.5 <= version < 3 else "xyxy_1000"


def key_of(convention: BoxConvention) -> str:
    """Return what models of the convention call a box in their training."""
    return "box_2d" if convention == "yxyx_1000" else "bbox_2d"


def described(convention: BoxConvention) -> str:
    """Return how a box has to be written, for the model."""
    scale = {
        "xyxy_unit": "as shares of the photo's width and height between 0 and 1",
        "xyxy_px": "in pixels of the photo",
        "xyxy_px_resized": "in pixels of the photo",
    }.get(convention, "in thousandths of the photo's height and width, whole numbers, 0 to 1000")
    return f"{_ORDER[convention]} {scale}"


def photo_box(values: Box, convention: BoxConvention, sent: Size, photo: Size) -> Box:
    """Return ``(x0, y0, x1, y1)`` in the photo's pixels of what a model wrote.

    ``sent`` is the size at which it was given the photo. The box may lie outside, and its
    corners may be swapped: see ``box_repair``.
    """
    if convention == "yxyx_1000":
        values = values[1], values[0], values[3], values[2]
    across, down = _units(convention, sent)
    fx, fy = photo[0] / across, photo[1] / down
    x0, y0, x1, y1 = values
    return fx * x0, fy * y0, fx * x1, fy * y1


def written_box(box: Box, convention: BoxConvention, sent: Size, photo: Size) -> list[float]:
    """Return a box of the photo's pixels as the model would write it."""
    across, down = _units(convention, sent)
    fx, fy = across / photo[0], down / photo[1]
    digits = 4 if convention == "xyxy_unit" else None
    x0, y0, x1, y1 = (round(f * v, digits) for f, v in zip((fx, fy, fx, fy), box, strict=True))
    return [y0, x0, y1, x1] if convention == "yxyx_1000" else [x0, y0, x1, y1]


def resized_by_model(sent: Size) -> Size:
    """Return the size to which Qwen2.5-VL's preprocessing brings an image.

    Sides become multiples of 28 and the area is kept within ``PIXEL_RANGE``.
    """
    least, most = PIXEL_RANGE
    width, height = sent
    area = width * height
    near = [max(SIDE_MULTIPLE, round(s / SIDE_MULTIPLE) * SIDE_MULTIPLE) for s in sent]
    if near[0] * near[1] > most:
        shrink = math.sqrt(area / most)
        near = [max(1, math.floor(s / shrink / SIDE_MULTIPLE)) * SIDE_MULTIPLE for s in sent]
    elif near[0] * near[1] < least:
        grow = math.sqrt(least / area)
        near = [math.ceil(s * grow / SIDE_MULTIPLE) * SIDE_MULTIPLE for s in sent]
    return near[0], near[1]


def _units(convention: BoxConvention, sent: Size) -> tuple[float, float]:
    """Return how many units the convention counts across the photo and down it."""
    if convention == "xyxy_px":
        return sent
    if convention == "xyxy_px_resized":
        return resized_by_model(sent)
    return (1.0, 1.0) if convention == "xyxy_unit" else (1000.0, 1000.0)
