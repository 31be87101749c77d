"""Fit a pinhole to the rays along which a model sees its points."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from garden_models.geometry.camera import pixel_grid

ROUNDS = 5
LEAST_DEPTH = 1e-6


def intrinsics_from_points(
    points_camera: Float[np.ndarray, "h w 3"], weight: Float[np.ndarray, "h w"]
) -> Float[np.ndarray, "3 3"]:
    """Return intrinsics in pixels (centres at +0.5) whose principal point is the middle.

    Least squares over pixels by ``weight``, those that miss the fit counting less and less
    (Cauchy). Raises ValueError if fewer than three pixels count.
    """
    height, width = weight.shape
    middle = np.array([width / 2, height / 2])
    pixels = pixel_grid(height, width) - middle
    use = (weight > 0) & (points_camera[..., 2] > LEAST_DEPTH)
    if use.sum() < 3:
        raise ValueError("too few points to fit a camera to")
    slopes = points_camera[use][:, :2].astype(np.float64) / points_camera[use][:, 2:]
    pixels, share = pixels[use], weight[use].astype(np.float64)
    focal = np.ones(2)
    robust = share[:, None] * np.ones(2)
    for _ in range(ROUNDS):
        focal = (robust * slopes * pixels).sum(0) / np.maximum((robust * slopes**2).sum(0), 1e-12)
        residual = np.abs(pixels - slopes * focal)
        spread = np.maximum(np.median(residual, axis=0), 1e-3)
        robust = share[:, None] / (1 + (residual / (2 * spread)) ** 2)
    return np.array([[focal[0], 0, middle[0]], [0, focal[1], middle[1]], [0, 0, 1.0]])
