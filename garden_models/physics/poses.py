"""Read the poses of bodies out of a MuJoCo state."""

from __future__ import annotations

import mujoco
import numpy as np
from jaxtyping import Float

from garden_models.scene import Body


def body_poses(
    model: mujoco.MjModel, data: mujoco.MjData, bodies: tuple[Body, ...]
) -> tuple[Float[np.ndarray, "b 3"], Float[np.ndarray, "b 4"]]:
    """Return position and quaternion (wxyz) of every body frame in the model's frame.

    Kinematics must be up to date with ``data.qpos`` (as after ``mj_forward``).
    """
    mujoco.mj_kinematics(model, data)
    ids = [model.body(body.name).id for body in bodies]
    return data.xpos[ids].copy(), data.xquat[ids].copy()
