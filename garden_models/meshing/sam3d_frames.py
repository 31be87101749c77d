"""Turn points, poses and meshes between SAM-3D Objects' frames and ours.

Its point maps and poses are in PyTorch3D's camera (x left, y up, z forward), its poses turn
row vectors with a quaternion wxyz and map the canonical frame (z up), its exported mesh is
y up. Ours are OpenCV cameras (x right, y down), column vectors, and y-down objects.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from garden_models.geometry.rotation import matrix_from_quaternion

PYTORCH3D_FROM_OPENCV = np.diag([-1.0, -1.0, 1.0])
"""Its own inverse."""

CANONICAL_FROM_EXPORTED = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""The exporter writes row vectors ``canonical @ M`` with this very matrix M: z up to y up."""

EXPORTED_FROM_OURS = np.diag([1.0, -1.0, -1.0])
"""y up from y down: half a turn about x, so that nothing is mirrored. Its own inverse."""


def points_in_pytorch3d(
    points_opencv: Float[np.ndarray, "*n 3"],
) -> Float[np.ndarray, "*n 3"]:
    """Return points of an OpenCV camera in PyTorch3D's; NaN stays NaN."""
    return points_opencv * np.diag(PYTORCH3D_FROM_OPENCV)


def mesh_in_our_frame(vertices_exported: Float[np.ndarray, "v 3"]) -> Float[np.ndarray, "v 3"]:
    """Return the exported (y up) mesh's vertices with y down."""
    return vertices_exported * np.diag(EXPORTED_FROM_OURS)


def camera_from_mesh(
    quaternion_wxyz: Float[np.ndarray, "4"],
    translation: Float[np.ndarray, "3"],
    scale: float,
) -> Float[np.ndarray, "4 4"]:
    """Return the similarity from the y-down mesh to the OpenCV camera, in the point map's unit.

    Row vectors: ``p_pytorch3d = scale * (p_canonical @ R(q)) + t``; so columns are turned by
    the transpose of R(q).
    """
    turn = (
        PYTORCH3D_FROM_OPENCV
        @ matrix_from_quaternion(quaternion_wxyz).T
        @ CANONICAL_FROM_EXPORTED
        @ EXPORTED_FROM_OURS
    )
    out = np.eye(4)
    out[:3, :3] = scale * turn
    out[:3, 3] = PYTORCH3D_FROM_OPENCV @ translation
    return out
