"""Baseline: photographers hold cameras upright, so the mean of their y axes points down."""

from __future__ import annotations

import numpy as np

from garden_models.scene import GravityEvidence, Reconstruction

NOMINAL_SIGMA_DEG = 20.0
"""The method states no uncertainty; photos look down by about this much."""


def estimate(reconstruction: Reconstruction) -> GravityEvidence | None:
    """Return the mean y axis of the cameras; None if there is none or they cancel out."""
    if not reconstruction.views:
        return None
    y = np.mean([view.camera_from_world[1, :3] for view in reconstruction.views], axis=0)
    length = float(np.linalg.norm(y))
    if length < 1e-6:
        return None
    note = f"mean of {len(reconstruction.views)} cameras, resultant {length:.2f}"
    return GravityEvidence("mean_camera_up", y / length, NOMINAL_SIGMA_DEG, True, note)
