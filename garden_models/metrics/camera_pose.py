"""Compare estimated cameras with true ones, whatever the frame and scale of each world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from garden_models.geometry.rigid import invert_rigid
from garden_models.geometry.rotation import angle_between_deg, rotation_angle_deg
from garden_models.geometry.umeyama import umeyama

Poses = Float[np.ndarray, "n 3 4"]
"""``camera_from_world`` of n cameras (OpenCV axes)."""


@dataclass(frozen=True)
class CameraPoseErrors:
    """Errors of n estimated cameras against the truth.

    ``rotation_deg`` is each camera's error after the best common rotation of the worlds;
    ``position`` each centre's distance from its true place after the best similarity, as a
    share of the true cameras' extent (their largest distance from their mean);
    ``pair_rotation_deg`` and ``pair_direction_deg`` are the errors of the relative rotation
    and of the direction of the relative translation of all pairs, which need no alignment.
    """

    rotation_deg: Float[np.ndarray, " n"]
    position: Float[np.ndarray, " n"]
    pair_rotation_deg: Float[np.ndarray, " p"]
    pair_direction_deg: Float[np.ndarray, " p"]


def camera_pose_errors(estimated: Poses, true: Poses) -> CameraPoseErrors:
    """Return the errors of ``estimated`` cameras, in the order of the ``true`` ones.

    Raises ValueError for fewer than three cameras, different numbers, or true cameras that
    all stand in one place.
    """
    if estimated.shape != true.shape or len(true) < 3:
        raise ValueError(
            f"need the same 3 or more cameras, got {len(estimated)} estimated, {len(true)} true"
        )
    turn = true_from_estimated_rotation(estimated, true)
    rotation = [
        rotation_angle_deg(t[:, :3] @ turn @ e[:, :3].T)
        for e, t in zip(estimated, true, strict=True)
    ]
    centres, true_centres = centres_of(estimated), centres_of(true)
    scale, align, shift = umeyama(centres, true_centres)
    extent = np.linalg.norm(true_centres - true_centres.mean(0), axis=1).max()
    misplaced = np.linalg.norm(scale * centres @ align.T + shift - true_centres, axis=1)
    pair_rotation, pair_direction = pair_errors(estimated, true)
    return CameraPoseErrors(np.array(rotation), misplaced / extent, pair_rotation, pair_direction)


def true_from_estimated_rotation(estimated: Poses, true: Poses) -> Float[np.ndarray, "3 3"]:
    """Return the rotation between the worlds that fits all cameras' rotations best (chordal)."""
    u, _, vt = np.linalg.svd(np.einsum("nij,nik->jk", true[:, :, :3], estimated[:, :, :3]))
    return u @ np.diag([1.0, 1.0, np.linalg.det(u) * np.linalg.det(vt)]) @ vt


def centres_of(poses: Poses) -> Float[np.ndarray, "n 3"]:
    """Return the cameras' centres in their world."""
    return -np.einsum("nji,nj->ni", poses[:, :, :3], poses[:, :, 3])


def pair_errors(
    estimated: Poses, true: Poses
) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, " p"]]:
    """Return rotation and translation-direction errors in degrees of all pairs.

    The direction of a pair that stands in one place (in either world) is NaN.
    """
    rotation, direction = [], []
    for i in range(len(true)):
        for j in range(i + 1, len(true)):
            ours = estimated[j] @ invert_rigid(estimated[i])
            theirs = true[j] @ invert_rigid(true[i])
            rotation.append(rotation_angle_deg(ours[:, :3] @ theirs[:, :3].T))
            apart = np.linalg.norm(ours[:, 3]) > 0 and np.linalg.norm(theirs[:, 3]) > 0
            direction.append(angle_between_deg(ours[:, 3], theirs[:, 3]) if apart else np.nan)
    return np.array(rotation), np.array(direction)
