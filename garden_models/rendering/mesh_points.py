"""Give bodies where they came to rest, as coloured points for viewers that draw only these."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

from garden_models.geometry.rigid import rigid, transform_points
from garden_models.geometry.rotation import matrix_from_quaternion
from garden_models.metrics.mesh import sample_surface
from garden_models.scene import Body, PointCloud, SimScene, Trajectory


def mesh_points(body: Body, gv_from_body: Float[np.ndarray, "4 4"], count: int) -> PointCloud:
    """Return ``count`` points spread evenly over the body at its pose, without normals.

    Each has the colour of the vertex nearest to it. Raises ValueError without any area.
    """
    vertices = np.asarray(body.vertices, np.float64)
    points = sample_surface(vertices, body.faces, count)
    nearest = cKDTree(vertices).query(points)[1]
    corners = vertices[body.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = float(np.linalg.norm(normals, axis=1).sum()) / 2
    return PointCloud(
        transform_points(gv_from_body, points),
        body.vertex_rgb[nearest],
        np.zeros((count, 3)),
        np.full(count, np.sqrt(area / max(count, 1))),
        np.ones(count),
    )


def settled_poses(
    scene: SimScene, trajectory: Trajectory | None
) -> tuple[Float[np.ndarray, "4 4"], ...]:
    """Return each body's ``gv_from_body`` at the simulation's end; as composed without one."""
    if trajectory is None:
        return tuple(body.gv_from_body for body in scene.bodies)
    return tuple(
        rigid(matrix_from_quaternion(quaternion), position)
        for quaternion, position in zip(
            trajectory.quaternions_gv[-1], trajectory.positions_gv[-1], strict=True
        )
    )
