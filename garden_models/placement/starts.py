"""Propose rough poses from the object's own points, for meshes whose pose is not known."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from garden_models.geometry.rotation import yaw_gv
from garden_models.meshing.extent import robust_bounds
from garden_models.placement.pose import UprightPose


def pose_from_points(
    vertices_object: Float[np.ndarray, "v 3"],
    base: Float[np.ndarray, "3 3"],
    points_gv: Float[np.ndarray, "n 3"],
    support_height: float | None,
    yaw_rad: float,
) -> UprightPose:
    """Return the pose at a given yaw whose bounding box fits that of the points.

    The scale is the ratio of the boxes' diagonals. Points reach from the object's top to
    its support, if it has one.
    """
    low, high = robust_bounds(points_gv)
    if support_height is not None:
        high[1] = max(support_height, low[1] + 1e-6)
    turned = vertices_object @ (yaw_gv(yaw_rad) @ base).T
    mesh_low, mesh_high = turned.min(axis=0), turned.max(axis=0)
    scale = float(np.linalg.norm(high - low) / np.linalg.norm(mesh_high - mesh_low))
    translation = 0.5 * (low + high) - scale * 0.5 * (mesh_low + mesh_high)
    translation[1] = high[1] - scale * mesh_high[1]
    return UprightPose(yaw_rad, translation, scale, base)
