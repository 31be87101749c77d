"""Choose the frame in which tokens are written: Gravity-View as if gravity were known."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from garden_models.geometry.gravity_view import gv_from_camera

Rotation = Float[np.ndarray, "3 3"]
Direction = Float[np.ndarray, "3"]


def frame_of(down_world: Direction, reference_rotation: Rotation) -> Rotation:
    """Return ``gv_from_world`` of a reference camera if ``down_world`` were gravity.

    Where it is gravity, it is what the decoder should find: the decoder then answers with the
    identity.
    """
    return gv_from_camera(reference_rotation @ down_world) @ reference_rotation


def habitual_down(rotations: Float[np.ndarray, "v 3 3"], reference: int) -> Direction:
    """Return the mean direction down of cameras taken to be upright."""
    mean = rotations[:, 1].mean(axis=0)
    if np.linalg.norm(mean) < 0.2:
        mean = rotations[reference, 1]
    return np.asarray(mean / np.linalg.norm(mean))


def starts(rotations: Float[np.ndarray, "v 3 3"], reference: int) -> Float[np.ndarray, "6 3"]:
    """Return the habitual direction down, its opposite, and four level with it.

    Together they are within 55 degrees of every direction, so that also what was photographed
    in no habitual way starts not far off.
    """
    frame = frame_of(habitual_down(rotations, reference), rotations[reference])
    x, y, z = frame
    return np.stack([y, -y, x, -x, z, -z])
