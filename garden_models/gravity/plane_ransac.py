"""Baseline: the largest plane by plain RANSAC is horizontal (paper, gravity table)."""

from __future__ import annotations

import numpy as np

from garden_models.geometry.camera import camera_centre
from garden_models.scene import GravityEvidence, Reconstruction

TRIALS = 1000
MAX_POINTS = 5000
TOLERANCE = 0.01
"""Inlier distance over the median distance of the points from the cameras' mean centre."""
NOMINAL_SIGMA_DEG = 5.0
"""The method states no uncertainty; this is what it is worth where it works."""


def estimate(reconstruction: Reconstruction) -> GravityEvidence | None:
    """Return the normal of the plane with the most points, pointing away from the cameras."""
    points = reconstruction.points_world.xyz.astype(np.float64)
    if len(points) < 3 or not reconstruction.views:
        return None
    rng = np.random.default_rng(0)
    points = points[rng.permutation(len(points))[:MAX_POINTS]]
    centre = np.mean([camera_centre(v.camera_from_world) for v in reconstruction.views], axis=0)
    tolerance = TOLERANCE * float(np.median(np.linalg.norm(points - centre, axis=1)))
    triples = points[rng.integers(len(points), size=(TRIALS, 3))]
    normals = np.cross(triples[:, 1] - triples[:, 0], triples[:, 2] - triples[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    proper = lengths > 1e-12
    if not proper.any():
        return None
    normals = normals[proper] / lengths[proper, None]
    offsets = np.einsum("ti,ti->t", normals, triples[proper, 0])
    inside = np.abs(points @ normals.T - offsets) < tolerance
    best = inside[:, int(np.argmax(inside.sum(0)))]
    mean = points[best].mean(0)
    normal = np.linalg.svd(points[best] - mean, full_matrices=False)[2][2]
    down = normal if normal @ (mean - centre) > 0 else -normal
    note = f"largest plane, {best.mean():.0%} of points"
    return GravityEvidence("plane_ransac", down, NOMINAL_SIGMA_DEG, True, note)
