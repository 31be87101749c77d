"""What a model that reads gravity from single photos is asked and answers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float, UInt8

_UNIT = 1e-3


@dataclass(frozen=True)
class PhotoGravityRequest:
    """Photos without distortion, with the focal length of each in its pixels."""

    SCHEMA: ClassVar[str] = "garden.PhotoGravityRequest/1"
    photos: tuple[UInt8[np.ndarray, "h w 3"], ...]
    focal_px: Float[np.ndarray, " n"]


@dataclass(frozen=True)
class PhotoGravity:
    """The direction down in each photo's camera (OpenCV axes, unit length), and its sigma."""

    SCHEMA: ClassVar[str] = "garden.PhotoGravity/1"
    down_camera: Float[np.ndarray, "n 3"]
    sigma_rad: Float[np.ndarray, " n"]

    def fits(self, request: PhotoGravityRequest) -> str | None:
        """Return what cannot be in this answer, None if nothing."""
        if len(self.down_camera) != len(request.photos):
            return f"{len(self.down_camera)} directions for {len(request.photos)} photos"
        if np.any(np.abs(np.linalg.norm(self.down_camera, axis=1) - 1) > _UNIT):
            return "a direction is not of unit length"
        if np.any(self.sigma_rad < 0):
            return "a sigma is negative"
        return None


ReadPhotoGravity = Callable[[PhotoGravityRequest], PhotoGravity]
