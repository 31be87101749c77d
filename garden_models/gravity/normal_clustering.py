"""Baseline: the direction that most normals share is up (paper, gravity table)."""

from __future__ import annotations

import numpy as np

from garden_models.geometry.direction import hemisphere
from garden_models.scene import GravityEvidence, Reconstruction

MAX_POINTS = 5000
KERNEL = np.radians(10.0)
GRID = 2000
NOMINAL_SIGMA_DEG = 5.0
"""The method states no uncertainty; this is what it is worth where it works."""


def estimate(reconstruction: Reconstruction) -> GravityEvidence | None:
    """Return the opposite of the densest direction of the normals (they face the cameras)."""
    normals = reconstruction.points_world.normal.astype(np.float64)
    if len(normals) < 3:
        return None
    keep = np.random.default_rng(0).permutation(len(normals))[:MAX_POINTS]
    normals = normals[keep]
    half = hemisphere(GRID // 2)
    grid = np.concatenate([half, -half])
    density = np.exp((grid @ normals.T - 1) / KERNEL**2).sum(1)
    up = grid[int(np.argmax(density))]
    for _ in range(20):
        weight = np.exp((normals @ up - 1) / KERNEL**2)
        up = weight @ normals
        up /= np.linalg.norm(up)
    share = float((normals @ up > np.cos(2 * KERNEL)).mean())
    note = f"densest normals, {share:.0%} of points"
    return GravityEvidence("normal_clustering", -up, NOMINAL_SIGMA_DEG, True, note)
