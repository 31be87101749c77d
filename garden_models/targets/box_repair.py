"""Read a box as a model wrote it, and mend what can be mended."""

from __future__ import annotations

import math
import re
from typing import Any

from garden_models.targets.answer_json import BOX_KEYS, Entry
from garden_models.targets.box_convention import Box, BoxConvention, Size, photo_box

SLACK = 0.05
"""How far beyond its photo a box may reach and still be cut, as a share of the side."""

SMALLEST_SHARE = 0.004
"""Of the photo's side; what is smaller is no object that can be modelled."""

LARGEST_SHARE = 0.98
_NUMBER = re.compile(r"[-+]?\d*\.?\d+(?:[eE][-+]?\d+)?")
_NAMED = (
    ("xmin", "ymin", "xmax", "ymax"),
    ("x_min", "y_min", "x_max", "y_max"),
    ("x0", "y0", "x1", "y1"),
    ("x1", "y1", "x2", "y2"),
    ("left", "top", "right", "bottom"),
)


class Unusable(ValueError):
    """A box, or an entry, that cannot be mended; the message says why."""


class OutsidePhoto(Unusable):
    """A box that lies outside of its photo."""


def read_box(
    entry: Entry, convention: BoxConvention, sent: Size, photo: Size, *, turned: bool = False
) -> tuple[Box, list[str]]:
    """Return an entry's box in the photo's pixels, inside it, and what had to be mended.

    ``turned`` reads it with across and down in the place of each other.
    Raises Unusable, or OutsidePhoto.
    """
    values, named = _values(entry)
    if turned and not named:
        values = values[1], values[0], values[3], values[2]
    notes: list[str] = []
    if convention != "xyxy_unit" and max(map(abs, values)) <= 1 and any(v % 1 for v in values):
        values = _from_unit(values, convention, sent)
        notes.append("its box was given in shares of the photo")
    if named and convention == "yxyx_1000":  # the order is said, so only the unit is left
        values = values[1], values[0], values[3], values[2]
    x0, y0, x1, y1 = photo_box(values, convention, sent, photo)
    if x0 > x1 or y0 > y1:
        x0, x1, y0, y1 = min(x0, x1), max(x0, x1), min(y0, y1), max(y0, y1)
        notes.append("the corners of its box were swapped")
    return _inside((x0, y0, x1, y1), photo, notes), notes


def _values(entry: Entry) -> tuple[Box, bool]:
    """Return the four numbers, and whether their order is said by their names."""
    raw = next((entry[key] for key in BOX_KEYS if key in entry), None)
    if isinstance(raw, list) and len(raw) == 1:
        raw = raw[0]
    if isinstance(raw, dict):
        for names in _NAMED:
            if all(name in raw for name in names):
                return _four([raw[name] for name in names]), True
        if all(name in raw for name in ("x", "y", "width", "height")):
            x, y, width, height = _four([raw[name] for name in ("x", "y", "width", "height")])
            return (x, y, x + width, y + height), True
        raise Unusable(f"its box has the keys {', '.join(map(str, list(raw)[:6]))}")
    if isinstance(raw, str):
        raw = _NUMBER.findall(raw)
    if isinstance(raw, list) and raw and all(isinstance(item, list) for item in raw):
        raw = [value for item in raw for value in item]
    if not isinstance(raw, list):
        raise Unusable("it has no box")
    return _four(raw), False


def _four(raw: list[Any]) -> Box:
    if len(raw) != 4:
        raise Unusable(f"its box has {len(raw)} numbers in place of 4")
    try:
        numbers = [float(value) for value in raw]
    except (TypeError, ValueError, OverflowError):
        raise Unusable("its box is not of numbers") from None
    if not all(math.isfinite(value) for value in numbers) or max(map(abs, numbers)) > 1e7:
        raise Unusable("its box is not of finite numbers")
    return numbers[0], numbers[1], numbers[2], numbers[3]


def _from_unit(values: Box, convention: BoxConvention, sent: Size) -> Box:
    """Return shares as the convention would have them, in its own order."""
    a, b, c, d = values
    if convention in ("xyxy_px", "xyxy_px_resized"):
        return a * sent[0], b * sent[1], c * sent[0], d * sent[1]
    return 1000 * a, 1000 * b, 1000 * c, 1000 * d


def _inside(box: Box, photo: Size, notes: list[str]) -> Box:
    """Return the box cut at the photo's border; Unusable if little of it can be meant."""
    width, height = photo
    x0, y0, x1, y1 = box
    beyond = max(-x0 / width, -y0 / height, x1 / width - 1, y1 / height - 1)
    if beyond > SLACK:
        raise OutsidePhoto(
            "its box lies outside of its photo (if many do, the model counts in another way: "
            "set propose.boxes)"
        )
    if beyond > 1e-6:
        notes.append("its box was cut at the photo's border")
        x0, y0, x1, y1 = max(0.0, x0), max(0.0, y0), min(float(width), x1), min(float(height), y1)
    across, down = (x1 - x0) / width, (y1 - y0) / height
    if min(across, down) < SMALLEST_SHARE:
        raise Unusable("its box has no area")
    if min(across, down) > LARGEST_SHARE:
        raise Unusable("its box is the whole photo")
    return x0, y0, x1, y1
