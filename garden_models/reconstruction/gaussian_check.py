"""Check that predicted Gaussians lie where the predicted depth is."""

from __future__ import annotations

import numpy as np

from garden_models.geometry.camera import inside_image, project
from garden_models.reconstruction.geometry_model import GeometryPrediction
from garden_models.scene import OK, Verdict

SAMPLES = 400
MAX_MISS = 0.3
"""Median difference from the depth of the photo, as a share of it: models place Gaussians
along rays by a depth of their own, which is near the other, but not it."""


def judge_gaussians(prediction: GeometryPrediction) -> Verdict:
    """Return a degraded verdict if Gaussians have another scale or place than the depth."""
    cloud = prediction.gaussians
    if cloud is None:
        return OK
    ratios = []
    for index, view in enumerate(prediction.views):
        own = np.flatnonzero(cloud.view == index)
        own = own[:: max(1, len(own) // SAMPLES)]
        pixels, z = project(cloud.mean[own].astype(np.float64), view.K, view.camera_from_world)
        height, width = view.depth.shape
        inside = inside_image(pixels, (width, height))
        column, row = pixels[inside].astype(np.int64).T
        depth = view.depth[row, column]
        near = np.zeros(len(own))
        near[inside] = np.where(depth > 0, z[inside] / np.maximum(depth, 1e-12), np.nan)
        ratios.append(near)
    found = np.concatenate(ratios)
    found = found[np.isfinite(found)]
    if len(found) == 0:
        return Verdict("degraded", ("the model predicted no Gaussian that a photo could see",))
    miss = float(np.median(np.abs(found - 1)))
    if miss < MAX_MISS:
        return OK
    return Verdict(
        "degraded",
        (
            f"the predicted Gaussians lie at {np.median(found):.2f} times the predicted depth: "
            "they are not of the same scale, or not of the same cameras",
        ),
    )
