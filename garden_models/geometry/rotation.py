"""Convert and compare rotations: axis-angle, quaternion (wxyz), 6D, angles in degrees."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

Matrix3 = Float[np.ndarray, "3 3"]
Vector3 = Float[np.ndarray, "3"]


def normalized(vector: Vector3) -> Vector3:
    """Return the unit vector; raise ValueError if its length is zero."""
    length = float(np.linalg.norm(vector))
    if length == 0.0:
        raise ValueError("cannot normalise a vector of length zero")
    return vector / length


def angle_between_deg(a: Vector3, b: Vector3) -> float:
    """Return the angle between two vectors in degrees, exact for tiny and near-180 angles."""
    a, b = normalized(a), normalized(b)
    return float(np.degrees(2 * np.arctan2(np.linalg.norm(a - b), np.linalg.norm(a + b))))


def rotation_angle_deg(rotation: Matrix3) -> float:
    """Return the angle of a rotation in degrees."""
    sine = np.linalg.norm(
        [
            rotation[2, 1] - rotation[1, 2],
            rotation[0, 2] - rotation[2, 0],
            rotation[1, 0] - rotation[0, 1],
        ]
    )
    return float(np.degrees(np.arctan2(sine, np.trace(rotation) - 1)))


def axis_angle(axis: Vector3, angle_rad: float) -> Matrix3:
    """Return the rotation about ``axis`` by ``angle_rad`` (Rodrigues)."""
    x, y, z = normalized(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle_rad) * cross + (1 - np.cos(angle_rad)) * cross @ cross


def yaw_gv(angle_rad: float) -> Matrix3:
    """Return the rotation about the Gravity-View y axis (down)."""
    return axis_angle(np.array([0.0, 1.0, 0.0]), angle_rad)


def rotation_between(a: Vector3, b: Vector3) -> Matrix3:
    """Return the smallest rotation that turns direction ``a`` to direction ``b``."""
    a, b = normalized(a), normalized(b)
    axis = np.cross(a, b)
    if np.linalg.norm(axis) < 1e-12:
        if a @ b > 0:
            return np.eye(3)
        other = np.eye(3)[int(np.argmin(np.abs(a)))]
        return axis_angle(np.cross(a, other), np.pi)
    return axis_angle(axis, float(np.arctan2(np.linalg.norm(axis), a @ b)))


def matrix_from_quaternion(wxyz: Float[np.ndarray, "4"]) -> Matrix3:
    """Return the rotation matrix of a quaternion (wxyz, any length but zero)."""
    w, x, y, z = wxyz / np.linalg.norm(wxyz)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_from_matrix(rotation: Matrix3) -> Float[np.ndarray, "4"]:
    """Return the unit quaternion (wxyz, w >= 0) of a rotation (Shepperd's method)."""
    r = rotation
    diagonal = np.array([np.trace(r), r[0, 0], r[1, 1], r[2, 2]])
    largest = int(np.argmax(diagonal))
    if largest == 0:
        q = np.array([1 + diagonal[0], r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    else:
        i = largest - 1
        j, k = (i + 1) % 3, (i + 2) % 3
        q = np.empty(4)
        q[0] = r[k, j] - r[j, k]
        q[1 + i] = 1 + r[i, i] - r[j, j] - r[k, k]
        q[1 + j] = r[j, i] + r[i, j]
        q[1 + k] = r[k, i] + r[i, k]
    q = q / np.linalg.norm(q)
    return -q if q[0] < 0 else q


def matrix_from_6d(six: Float[np.ndarray, "6"]) -> Matrix3:
    """Orthonormalise two 3-vectors into the first two rows (Zhou et al. 2019)."""
    first = normalized(six[:3])
    second = normalized(six[3:] - (first @ six[3:]) * first)
    return np.stack([first, second, np.cross(first, second)])
