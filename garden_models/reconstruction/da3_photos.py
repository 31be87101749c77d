"""Prepare photos as Depth-Anything-3 reads them."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import Float

from garden_models.reconstruction.photo_framing import Framing, Photo, frame_photos

LONG_SIDE, PATCH = 504, 14
MEAN, STD = np.array([0.485, 0.456, 0.406]), np.array([0.229, 0.224, 0.225])


def prepare(photos: Sequence[Photo]) -> tuple[Float[np.ndarray, "n 3 h w"], tuple[Framing, ...]]:
    """Return photos as the backbone reads them: long side 504, sides multiples of 14, ImageNet
    statistics, cut to the smallest of them about the middle.
    """
    pictures, framings = frame_photos(photos, resized)
    normal = (pictures.astype(np.float32) / 255 - MEAN) / STD
    return normal.transpose(0, 3, 1, 2).astype(np.float32), framings


def bounded_size(size: tuple[int, int]) -> tuple[int, int]:
    """Return (width, height) with the long side at 504."""
    factor = LONG_SIDE / max(size)
    return max(1, round(size[0] * factor)), max(1, round(size[1] * factor))


def target_size(size: tuple[int, int]) -> tuple[int, int]:
    """Return (width, height) with the long side at 504, then both at multiples of 14."""
    width, height = bounded_size(size)
    return _nearest_multiple(width), _nearest_multiple(height)


def resized(photo: Photo) -> Photo:
    """Return a photo at the size that the network reads, in the two steps of its own code."""
    size = photo.shape[1], photo.shape[0]
    first, second = bounded_size(size), target_size(size)
    bounded = _resize(photo, first, max(size) < LONG_SIDE)
    return _resize(bounded, second, second[0] > first[0] or second[1] > first[1])


def _nearest_multiple(side: int) -> int:
    return max(PATCH, (side + PATCH // 2) // PATCH * PATCH)


def _resize(photo: Photo, size: tuple[int, int], enlarged: bool) -> Photo:
    if (photo.shape[1], photo.shape[0]) == size:
        return photo
    method = cv2.INTER_CUBIC if enlarged else cv2.INTER_AREA
    return np.asarray(cv2.resize(photo, size, interpolation=method), np.uint8)
