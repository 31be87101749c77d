"""Build the Gravity-View frame from gravity in a camera (paper, section 3.1)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from garden_models.geometry.rigid import rigid
from garden_models.geometry.rotation import normalized

PARALLEL = 1e-6
"""Length of ``y x v`` under which the view direction counts as parallel to gravity."""


def gv_from_camera(gravity_camera: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """Return the rotation from an OpenCV camera to Gravity-View.

    ``y`` is gravity (down), ``x = y x v`` with ``v`` the view direction (0, 0, 1),
    ``z = x x y``; the rows are ``[x, y, z]``. Where ``v`` is parallel to gravity, ``x``
    falls back to the camera's x axis, made perpendicular to gravity.
    """
    y = normalized(gravity_camera)
    x = np.cross(y, np.array([0.0, 0.0, 1.0]))
    if np.linalg.norm(x) < PARALLEL:
        x = np.array([1.0, 0.0, 0.0]) - y[0] * y
    x = normalized(x)
    return np.stack([x, y, np.cross(x, y)])


def gv_from_world(
    down_world: Float[np.ndarray, "3"], reference_from_world: Float[np.ndarray, "r 4"]
) -> Float[np.ndarray, "4 4"]:
    """Return the rigid transform from the world to Gravity-View of a reference camera.

    The origin of Gravity-View is the reference camera's centre:
    ``gv_from_world = gv_from_reference @ reference_from_world``.
    """
    rotation = gv_from_camera(reference_from_world[:3, :3] @ down_world)
    return rigid(rotation @ reference_from_world[:3, :3], rotation @ reference_from_world[:3, 3])
