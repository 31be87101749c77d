"""Export a scene as MJCF for other programs: z-up, metres, meshes beside it."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from garden_models.geometry.rigid import rigid
from garden_models.geometry.rotation import matrix_from_quaternion
from garden_models.physics.mjcf import ZUP_FROM_GV, Mjcf, write_mjcf
from garden_models.scene import SimScene, Trajectory


def mjcf_zup(
    scene: SimScene,
    trajectory: Trajectory | None = None,
    *,
    name: str = "scene",
    mesh_prefix: str = "assets/",
) -> Mjcf:
    """Return the scene as MJCF in a z-up frame with the origin of Gravity-View.

    Keyframe ``recon`` holds the poses as reconstructed; ``settled``, if a trajectory is
    given, those at its end. The model's own pose is ``recon``.
    """
    poses = {"recon": tuple(body.gv_from_body for body in scene.bodies)}
    if trajectory is not None:
        poses["settled"] = final_poses(trajectory)
    return write_mjcf(
        scene.bodies,
        scene.supports,
        ZUP_FROM_GV,
        name=name,
        mesh_prefix=mesh_prefix,
        visuals=True,
        keyframes=poses,
    )


def final_poses(trajectory: Trajectory) -> tuple[Float[np.ndarray, "4 4"], ...]:
    """Return every body's ``gv_from_body`` at the end."""
    return tuple(
        rigid(matrix_from_quaternion(quaternion), position)
        for quaternion, position in zip(
            trajectory.quaternions_gv[-1], trajectory.positions_gv[-1], strict=True
        )
    )
