"""Bring photos to the one size that a model reads, and what it answers back to whole photos."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, UInt8

from garden_models.geometry.camera import resize_intrinsics

Photo = UInt8[np.ndarray, "h w 3"]


@dataclass(frozen=True)
class Framing:
    """A photo of ``photo_size`` was resized to ``size``; of that the model saw ``seen_size``
    pixels from ``corner`` (left, top) on. Sizes are (width, height).
    """

    photo_size: tuple[int, int]
    size: tuple[int, int]
    corner: tuple[int, int]
    seen_size: tuple[int, int]

    def seen(self) -> Bool[np.ndarray, "h w"]:
        """Tell which pixels of the resized photo the model saw."""
        return self.whole(np.ones(self.seen_size[::-1], bool))

    def whole(self, part: np.ndarray) -> np.ndarray:
        """Return what the model says of its pixels as a map of the resized photo; 0 beyond."""
        (width, height), (left, top) = self.size, self.corner
        out = np.zeros((height, width), part.dtype)
        out[top : top + part.shape[0], left : left + part.shape[1]] = part
        return out

    def model_intrinsics(self, photo_K: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "3 3"]:
        """Return the intrinsics of the model's pixels for those of the photo."""
        K = resize_intrinsics(photo_K, self.photo_size, self.size)
        K[:2, 2] -= self.corner
        return K

    def whole_intrinsics(self, model_K: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "3 3"]:
        """Return the intrinsics of the resized photo for those of the model's pixels."""
        K = model_K.astype(np.float64)
        K[:2, 2] += self.corner
        return K


def frame_photos(
    photos: Sequence[Photo], resize: Callable[[Photo], Photo], longest: int | None = None
) -> tuple[UInt8[np.ndarray, "n h w 3"], tuple[Framing, ...]]:
    """Return resized photos, cut about their middles to the smallest of them (and to at most
    ``longest``), and how.
    """
    resized = [resize(photo) for photo in photos]
    height, width = (
        min(*(photo.shape[axis] for photo in resized), longest or 2**31) for axis in (0, 1)
    )
    pictures, framings = [], []
    for photo, small in zip(photos, resized, strict=True):
        top, left = (small.shape[0] - height) // 2, (small.shape[1] - width) // 2
        pictures.append(small[top : top + height, left : left + width])
        framings.append(
            Framing(
                (photo.shape[1], photo.shape[0]),
                (small.shape[1], small.shape[0]),
                (left, top),
                (width, height),
            )
        )
    return np.stack(pictures), tuple(framings)
