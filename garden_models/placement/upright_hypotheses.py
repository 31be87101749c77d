"""Keep a pose estimator's rotations upright: turns about gravity only (paper, section 3.2)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from garden_models.geometry.rotation import yaw_gv
from garden_models.geometry.upright import nearest_yaw

YAW_STEP_DEG = 10.0


def upright_rotations(
    gv_from_camera: Float[np.ndarray, "3 3"], step_deg: float = YAW_STEP_DEG
) -> Float[np.ndarray, "n 3 3"]:
    """Return ``camera_from_object`` of an upright object at all headings, ``step_deg`` apart."""
    count = round(360.0 / step_deg)
    yaws = 2.0 * np.pi * np.arange(count) / count
    return np.stack([gv_from_camera.T @ yaw_gv(float(yaw)) for yaw in yaws])


def made_upright(
    camera_from_object: Float[np.ndarray, "n 4 4"], gv_from_camera: Float[np.ndarray, "3 3"]
) -> Float[np.ndarray, "n 4 4"]:
    """Return the poses with the nearest upright rotations; translations stay."""
    out = np.array(camera_from_object, float)
    for pose in out:
        yaw = nearest_yaw(gv_from_camera @ pose[:3, :3])
        pose[:3, :3] = gv_from_camera.T @ yaw_gv(yaw)
    return out


def distinct(poses: Float[np.ndarray, "n 4 4"], size: float, keep: int) -> list[int]:
    """Return the first poses, at most ``keep``, that differ by more than noise.

    The same are those within 10 degrees and a twentieth of the object's ``size``.
    """
    chosen: list[int] = []
    for index, pose in enumerate(poses):
        same = any(
            np.trace(pose[:3, :3].T @ poses[other][:3, :3]) > 1.0 + 2.0 * np.cos(np.radians(10.0))
            and np.linalg.norm(pose[:3, 3] - poses[other][:3, 3]) < size / 20
            for other in chosen
        )
        if not same:
            chosen.append(index)
        if len(chosen) == keep:
            break
    return chosen
