"""Register a mesh to the object's points by iterated closest points, upright."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

from garden_models.metrics.mesh import sample_surface
from garden_models.placement.pose import UprightPose

STEPS = 12
KEPT = 0.9
"""Share of the nearest pairs that is used; the rest may be stray points."""

SAMPLES = 6000


def register_to_points(
    vertices_object: Float[np.ndarray, "v 3"],
    faces: np.ndarray,
    points_gv: Float[np.ndarray, "n 3"],
    pose: UprightPose,
    seed: int = 0,
) -> UprightPose:
    """Return the pose (yaw, translation and scale) that brings the mesh to the points.

    Every point is drawn to the nearest place on the mesh, not the other way round, so parts
    of the mesh that nobody saw do not matter.
    """
    surface = sample_surface(vertices_object, faces, SAMPLES, seed)
    tree = cKDTree(surface)
    points = points_gv[:: len(points_gv) // SAMPLES + 1].astype(float)
    for _ in range(STEPS):
        in_object = (points - pose.translation_gv) @ pose.rotation_gv / pose.scale
        distance, index = tree.query(in_object)
        near = distance <= np.quantile(distance, KEPT)
        placed = pose.apply(surface[index[near]])
        pose = pose.moved(_best_step(placed, points[near], pose))
    return pose


def _best_step(
    placed_gv: Float[np.ndarray, "k 3"], points_gv: Float[np.ndarray, "k 3"], pose: UprightPose
) -> Float[np.ndarray, "5"]:
    """Return the least-squares step of yaw, translation and log scale (closed form)."""
    mean_a, mean_b = placed_gv.mean(axis=0), points_gv.mean(axis=0)
    a, b = placed_gv - mean_a, points_gv - mean_b
    # yaw_gv turns (x, z) by x' = x cos + z sin, z' = z cos - x sin.
    sine = float((b[:, 0] * a[:, 2] - b[:, 2] * a[:, 0]).sum())
    cosine = float((b[:, 0] * a[:, 0] + b[:, 2] * a[:, 2]).sum())
    yaw = float(np.arctan2(sine, cosine))
    c, s = np.cos(yaw), np.sin(yaw)
    turned = np.column_stack([c * a[:, 0] + s * a[:, 2], a[:, 1], c * a[:, 2] - s * a[:, 0]])
    grow = float((turned * b).sum() / max((a**2).sum(), 1e-30))
    grow = float(np.clip(grow, 0.8, 1.25))
    arm = pose.translation_gv - mean_a
    moved = np.array([c * arm[0] + s * arm[2], arm[1], c * arm[2] - s * arm[0]])
    target = mean_b + grow * moved
    return np.concatenate([[yaw], target - pose.translation_gv, [np.log(grow)]])
