"""Compare depth maps with true ones after one scale for the whole scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float

from garden_models.geometry.camera import pixel_grid, pixel_rays

Depth = Float[np.ndarray, "h w"]


@dataclass(frozen=True)
class DepthScore:
    """How good a scene's depth maps are.

    ``scale`` turns estimated into true units (median ratio over all pixels that have both).
    Errors are relative, |scale * estimate / truth - 1|. Shares are of the pixels that have a
    true depth: ``valid`` have an estimate, ``within_1_percent`` have one that good.
    """

    scale: float
    median_relative_error: float
    valid: float
    within_1_percent: float
    views: int


def score_depths(estimates: Sequence[Depth], truths: Sequence[Depth]) -> DepthScore:
    """Score estimated z-depth maps against true ones of the same sizes (0 = none).

    Raises ValueError for different lengths or shapes, or if nothing can be compared.
    """
    if len(estimates) != len(truths):
        raise ValueError(f"expected as many truths as maps, got {len(truths)} and {len(estimates)}")
    ratios, known = [], 0
    for estimate, truth in zip(estimates, truths, strict=True):
        if estimate.shape != truth.shape:
            raise ValueError(f"depth map has shape {estimate.shape}, its truth {truth.shape}")
        known += int(np.count_nonzero(truth > 0))
        both = (estimate > 0) & (truth > 0)
        ratios.append(estimate[both].astype(np.float64) / truth[both])
    ratio = np.concatenate(ratios) if ratios else np.zeros(0)
    if len(ratio) == 0:
        raise ValueError("no pixel has both an estimated and a true depth")
    scale = 1.0 / float(np.median(ratio))
    error = np.abs(scale * ratio - 1.0)
    return DepthScore(
        scale=scale,
        median_relative_error=float(np.median(error)),
        valid=len(ratio) / known,
        within_1_percent=float(np.count_nonzero(error < 0.01) / known),
        views=len(truths),
    )


def truth_at_view(
    truth: Depth,
    view_K: Float[np.ndarray, "3 3"],
    view_size: tuple[int, int],
    distortion: Float[np.ndarray, "4"],
) -> Depth:
    """Sample a photo's true depth map at the pixels of its undistorted working view.

    The truth covers the photo (any resolution), seen through the lens ``distortion`` (OpenCV
    k1, k2, p1, p2) that was removed from the view with camera matrix ``view_K`` for
    ``view_size`` = (width, height). Nearest samples, since a mean of two surfaces is
    neither; 0 outside of the photo.
    """
    width, height = view_size
    rays = pixel_rays(pixel_grid(height, width), view_K).reshape(-1, 3)
    projected, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), view_K, distortion)
    pixels = projected[:, 0] * (np.array(truth.shape[::-1]) / view_size)
    column, row = np.floor(pixels).astype(int).T
    inside = (column >= 0) & (row >= 0) & (column < truth.shape[1]) & (row < truth.shape[0])
    sampled = np.zeros(height * width, truth.dtype)
    sampled[inside] = truth[row[inside], column[inside]]
    return sampled.reshape(height, width)
