"""Choose the photos that a model is shown, and draw boxes into them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import UInt8

from garden_models.scene import BadInput, Capture, Photo, Target
from garden_models.targets.box_convention import BoxConvention, Size, resized_by_model
from garden_models.targets.vlm_model import LabelledImage

JPEG_QUALITY = 90
_COLOURS = ((230, 25, 75), (60, 180, 75), (0, 130, 200), (245, 130, 48), (145, 30, 180))


@dataclass(frozen=True)
class ShownPhoto:
    """A photo as it is sent: under a label, at its own size.

    ``original`` is the size of the file, in whose pixels boxes of targets are.
    """

    label: str
    name: str
    rgb: UInt8[np.ndarray, "h w 3"]
    original: Size

    @property
    def size(self) -> Size:
        """(width, height) in pixels as sent."""
        return self.rgb.shape[1], self.rgb.shape[0]


def choose_photos(capture: Capture, leave_out: Sequence[str], most: int) -> tuple[Photo, ...]:
    """Return up to ``most`` photos, evenly over the capture; BadInput if none is left."""
    left = [photo for photo in capture.photos if photo.name not in set(leave_out)]
    if not left:
        raise BadInput("no photo is left to look for targets in: none could be registered")
    chosen = np.unique(np.linspace(0, len(left) - 1, min(most, len(left))).round().astype(int))
    return tuple(left[i] for i in chosen)


def shown_photos(
    photos: Sequence[Photo], long_side: int, convention: BoxConvention
) -> tuple[ShownPhoto, ...]:
    """Return photos no larger than ``long_side``, labelled P1, P2, ...

    Labels, not file names: these may be untidy, or say more than the photos show. For a
    model that counts in pixels of what it resizes itself they come resized.
    """
    return tuple(
        ShownPhoto(
            f"P{i}", photo.name, _scaled(photo.rgb, long_side, convention), photo.original_size
        )
        for i, photo in enumerate(photos, start=1)
    )


def pictures(
    photos: Sequence[ShownPhoto], drawn: Sequence[Target] = ()
) -> tuple[LabelledImage, ...]:
    """Return the photos as JPEG, with numbered boxes of the targets in ``drawn`` in them."""
    return tuple(LabelledImage(photo.label, _jpeg(_with_boxes(photo, drawn))) for photo in photos)


def _scaled(
    rgb: UInt8[np.ndarray, "h w 3"], long_side: int, convention: BoxConvention
) -> UInt8[np.ndarray, "h2 w2 3"]:
    height, width = rgb.shape[:2]
    factor = min(1.0, long_side / max(height, width))
    size = max(1, round(factor * width)), max(1, round(factor * height))
    if convention == "xyxy_px_resized":
        size = resized_by_model(size)
    if size == (width, height):
        return rgb
    return np.asarray(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA), np.uint8)


def _with_boxes(photo: ShownPhoto, targets: Sequence[Target]) -> UInt8[np.ndarray, "h w 3"]:
    rgb = photo.rgb.copy()
    thick = max(2, round(max(photo.size) / 400))
    for number, target in enumerate(targets, start=1):
        if target.photo != photo.name:
            continue
        colour = _COLOURS[number % len(_COLOURS)]
        factors = (photo.size[0] / photo.original[0], photo.size[1] / photo.original[1]) * 2
        x0, y0, x1, y1 = (round(f * v) for f, v in zip(factors, target.box, strict=True))
        cv2.rectangle(rgb, (x0, y0), (x1, y1), colour, thick)
        at = (x0 + thick, max(y0 - 2 * thick, 8 * thick))
        cv2.putText(rgb, str(number), at, cv2.FONT_HERSHEY_SIMPLEX, 0.3 * thick, colour, thick)
    return rgb


def _jpeg(rgb: UInt8[np.ndarray, "h w 3"]) -> bytes:
    bgr = cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR)
    done, data = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    assert done
    return bytes(data)
