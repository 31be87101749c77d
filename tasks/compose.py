"""Compose bodies and supports into a simulated scene (paper, section 3.4). Seconds, CPU.

Convex decomposition is foreign code that may hang: it runs in a child process.
"""

from __future__ import annotations

import numpy as np

from garden_models.physics.config import Compose
from garden_models.progress import Progress, silent
from garden_models.scene import (
    Background,
    GravityView,
    ObjectMasks,
    ObjectMesh,
    Placement,
    Reconstruction,
    SimScene,
)
from tasks.step import step


@step(
    version=1,
    packages=("numpy", "scipy", "coacd", "trimesh", "mujoco", "opencv-python-headless"),
    isolated=True,
    time_limit_s=1800,
    memory_limit_gb=4,
    memory_gb=1.0,
)
def compose(
    reconstruction: Reconstruction,
    gravity_view: GravityView,
    masks: tuple[ObjectMasks, ...],
    meshes: tuple[ObjectMesh, ...],
    placements: tuple[Placement, ...],
    background: Background,
    config: Compose,
    progress: Progress = silent,
) -> SimScene:
    """Return bodies with convex pieces, mass and inertia, and what carries them."""
    from garden_models.geometry.camera import camera_centre
    from garden_models.geometry.rigid import transform_points
    from garden_models.physics.compose import compose as run

    centres = np.stack([camera_centre(view.camera_from_world) for view in reconstruction.views])
    centres_gv = transform_points(gravity_view.gv_from_world, centres)
    return run(
        meshes,
        placements,
        masks,
        background,
        gravity_view,
        reconstruction.scale,
        config,
        progress,
        centres_gv,
    )
