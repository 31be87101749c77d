"""Say what a file of cameras tells of one photo."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class PosedCamera:
    """A known camera: OpenCV axes, ``K`` in pixels of ``size`` = (width, height).

    ``distortion`` is OpenCV's k1, k2, p1, p2.
    """

    photo: str
    size: tuple[int, int]
    K: Float[np.ndarray, "3 3"]
    distortion: Float[np.ndarray, "4"]
    camera_from_world: Float[np.ndarray, "3 4"]
