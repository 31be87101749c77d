"""Render a scene at the photos' cameras: before and after the simulation, and without objects."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from garden_models.geometry.rigid import rigid
from garden_models.geometry.rotation import matrix_from_quaternion
from garden_models.progress import Progress, silent
from garden_models.rendering.config import RenderViews
from garden_models.rendering.hybrid import render_scene, world_camera
from garden_models.rendering.splat import splat_points
from garden_models.scene import (
    OK,
    Background,
    BadInput,
    GravityView,
    Reconstruction,
    Render,
    Renders,
    SimScene,
    Trajectory,
    Verdict,
    View,
)


def render_views(
    scene: SimScene,
    trajectory: Trajectory,
    background: Background,
    reconstruction: Reconstruction,
    gravity_view: GravityView,
    target_photos: Sequence[str] = (),
    config: RenderViews = RenderViews(),
    progress: Progress = silent,
) -> Renders:
    """Render at the targets' photos and at others, evenly spread, up to ``most_views``.

    Raises BadInput if the trajectory is of other bodies than the scene's.
    """
    if [motion.name for motion in trajectory.motions] != [body.name for body in scene.bodies]:
        raise BadInput("the trajectory is of other bodies than the scene: simulate it again")
    before = [body.gv_from_body for body in scene.bodies]
    after = [
        rigid(matrix_from_quaternion(quaternion), position)
        for quaternion, position in zip(
            trajectory.quaternions_gv[-1], trajectory.positions_gv[-1], strict=True
        )
    ]
    views = chosen_views(reconstruction.views, target_photos, config.most_views)
    renders = []
    empty = []
    for i, view in enumerate(views):
        progress(i / len(views), view.photo)
        camera = world_camera(view.camera_from_world, gravity_view.gv_from_world)
        points = splat_points(
            background.points_gv, camera, view.K, view.size, config.drawing.splatting
        )
        pictures = [
            render_scene(bodies, poses, points, camera, view.K, view.size, config.drawing)
            for bodies, poses in ((scene.bodies, before), (scene.bodies, after), ((), ()))
        ]
        empty.append(float((pictures[0].depth == 0).mean()))
        renders.append(
            Render(
                view.photo,
                pictures[0].rgb,
                pictures[1].rgb,
                pictures[2].rgb,
                pictures[1].object_ids,
            )
        )
    return Renders(tuple(renders), _verdict(empty))


def chosen_views(
    views: Sequence[View], target_photos: Sequence[str], most: int
) -> tuple[View, ...]:
    """Return the targets' photos and views spread evenly between them, in capture order."""
    chosen = [i for i, view in enumerate(views) if view.photo in set(target_photos)][:most]
    while len(chosen) < min(most, len(views)):
        # The view that is farthest, in the order of the capture, from those chosen so far.
        distance = [min((abs(i - j) for j in chosen), default=0) for i in range(len(views))]
        chosen.append(int(np.argmax(distance)))
    return tuple(views[i] for i in sorted(chosen))


def _verdict(empty: Sequence[float]) -> Verdict:
    """Remark on how much of the pictures has no geometry behind it."""
    if not empty or max(empty) == 0:
        return OK
    share = float(np.mean(empty))
    return Verdict("ok", (f"{share:.0%} of the rendered pixels have no reconstructed point",))
