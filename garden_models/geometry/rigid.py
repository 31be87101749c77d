"""Apply, invert and compose affine transforms given as 3x4 or 4x4 matrices."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float


def homogeneous(matrix: Float[np.ndarray, "r 4"]) -> Float[np.ndarray, "4 4"]:
    """Return the 4x4 form of a 3x4 or 4x4 transform."""
    out = np.eye(4)
    out[:3] = matrix[:3]
    return out


def invert_rigid(b_from_a: Float[np.ndarray, "r 4"]) -> Float[np.ndarray, "4 4"]:
    """Return ``a_from_b`` (4x4) of a rotation and translation."""
    rotation = b_from_a[:3, :3].T
    out = np.eye(4)
    out[:3, :3] = rotation
    out[:3, 3] = -rotation @ b_from_a[:3, 3]
    return out


def transform_points(
    b_from_a: Float[np.ndarray, "r 4"], points_a: Float[np.ndarray, "*n 3"]
) -> Float[np.ndarray, "*n 3"]:
    """Apply an affine transform to points."""
    return points_a @ b_from_a[:3, :3].T + b_from_a[:3, 3]


def rigid(
    rotation: Float[np.ndarray, "3 3"], translation: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "4 4"]:
    """Return the 4x4 transform ``x -> rotation @ x + translation``."""
    out = np.eye(4)
    out[:3, :3] = rotation
    out[:3, 3] = translation
    return out
