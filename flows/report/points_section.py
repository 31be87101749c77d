"""Show the settled scene upright: points to be turned in the browser, and still pictures."""

from __future__ import annotations

import base64
import json
from dataclasses import dataclass, replace
from html import escape

import numpy as np
from jaxtyping import Float

from flows.report.packed_points import Cube, Group, cube_around, pack_points, thinned
from flows.report.pictures import figure
from flows.report.values import SceneValues
from garden_models.geometry.rigid import transform_points
from garden_models.rendering.config import Drawing, Splatting
from garden_models.rendering.hybrid import render_scene, world_camera
from garden_models.rendering.mesh_points import mesh_points, settled_poses
from garden_models.rendering.viewpoint import (
    FIELD_OF_VIEW_DEG,
    Viewpoint,
    bounding_sphere,
    intrinsics,
    viewpoint_towards,
)
from garden_models.scene import Body, PointCloud, View

NEAR_POINTS, FAR_POINTS, OBJECT_POINTS = 70_000, 40_000, 40_000
"""Most points in the viewer: of the background near the objects, and beyond, and of objects."""

STILL_POINTS, STILL_SIZE = 250_000, (720, 450)
BACKDROP = (32, 38, 43)
"""As behind the viewer (page.css)."""

HOW_TO = (
    "Drag to turn it, shift-drag to move it; click it, then the wheel or + and − zoom and the "
    "arrow keys turn. Down is gravity."
)
NO_VIEWER = (
    "This browser shows no WebGL (or runs no scripts), so the points cannot be turned here; the "
    "pictures below show them."
)


@dataclass(frozen=True)
class _Shown:
    """What is shown, in GV: the background, the bodies where they came to rest, from where."""

    background: PointCloud
    bodies: tuple[Body, ...]
    poses: tuple[Float[np.ndarray, "4 4"], ...]
    radius: float
    viewpoint: Viewpoint
    photo: str


def points_section(values: SceneValues) -> str:
    """Return the upright scene, to be turned with the mouse; empty before there are points."""
    shown = _shown(values)
    if shown is None:
        return ""
    what = "The objects where they came to rest, and the background" if shown.bodies else "Points"
    return (
        f'<p class="dim">{what}, upright, seen as from photo {escape(shown.photo)}.</p>'
        f'<p class="dim" id="no-viewer">{NO_VIEWER}</p>{_viewer(shown)}'
        f'<div class="row two">{_stills(shown)}</div>'
    )


def _viewer(shown: _Shown) -> str:
    """Return the canvas with its switches, and the points that points_viewer.js draws in it."""
    groups = _groups(shown)
    cube = cube_around(groups)
    packed, listed = pack_points(groups, cube)
    view = _view_json(shown.viewpoint, cube)
    switches = "".join(
        f'<label><input type="checkbox" data-group="{name}" checked> {name}</label>'
        for name in (("background", "objects") if shown.bodies else ())
    )
    return (
        f'<div id="viewer" hidden><canvas id="points" tabindex="0" role="img" '
        f'aria-label="The points of the scene, to be turned" '
        f"data-groups='{json.dumps(listed)}' data-view='{json.dumps(view)}'></canvas>"
        f'<div class="controls">{switches}<button type="button" id="reset">first view</button>'
        f'<span class="dim">{HOW_TO}</span></div></div><script type="text/plain" '
        f'id="points-data">{base64.b64encode(packed).decode()}</script>'
    )


def _shown(values: SceneValues) -> _Shown | None:
    if values.reconstruction is None or values.gravity_view is None:
        return None
    if values.background is not None:
        background = values.background.points_gv
    else:
        world = values.reconstruction.points_world
        xyz = transform_points(values.gravity_view.gv_from_world, world.xyz)
        background = replace(world, xyz=xyz)
    if not len(background):
        return None
    bodies = values.scene.bodies if values.scene else ()
    poses = settled_poses(values.scene, values.trajectory) if values.scene else ()
    view = _chosen_view(values)
    camera = world_camera(view.camera_from_world, values.gravity_view.gv_from_world)
    eye = -camera[:3, :3].T @ camera[:3, 3]
    if bodies:
        placed = [transform_points(p, b.vertices) for p, b in zip(poses, bodies, strict=True)]
        centre, radius = bounding_sphere(placed)
        viewpoint = viewpoint_towards(centre, radius, eye, share=0.5)
    else:
        depth = float(np.median(view.depth[view.depth > 0])) if (view.depth > 0).any() else 1.0
        centre, radius = eye + depth * camera[2, :3], 0.4 * depth
        viewpoint = viewpoint_towards(centre, radius, eye, share=0.4)
    return _Shown(background, tuple(bodies), tuple(poses), radius, viewpoint, view.photo)


def _chosen_view(values: SceneValues) -> View:
    """Return the view of the first target's photo, else the one that gravity refers to."""
    assert values.reconstruction is not None
    assert values.gravity_view is not None
    views = {view.photo: view for view in values.reconstruction.views}
    wished = [t.photo for t in values.result.refs.targets]
    wished.append(values.gravity_view.reference_photo)
    return next((views[photo] for photo in wished if photo in views), next(iter(views.values())))


def _groups(shown: _Shown) -> list[Group]:
    """Return the points by switch; near the objects more of the background is kept."""
    away = np.linalg.norm(shown.background.xyz - shown.viewpoint.centre, axis=1)
    near = away < 4 * shown.radius
    groups = [
        Group("background", thinned(shown.background.subset(near), NEAR_POINTS)),
        Group("background", thinned(shown.background.subset(~near), FAR_POINTS)),
    ]
    for body, pose in zip(shown.bodies, shown.poses, strict=True):
        count = OBJECT_POINTS // len(shown.bodies)
        groups.append(Group("objects", mesh_points(body, pose, count)))
    return [group for group in groups if len(group.points)]


def _view_json(viewpoint: Viewpoint, cube: Cube) -> dict[str, object]:
    """Return the first view in the cube's units, angles in radians."""
    centre = cube.to_unit(viewpoint.centre[None])[0]
    return {
        "centre": [round(float(c), 5) for c in centre],
        "yaw": round(float(np.radians(viewpoint.yaw_deg)), 5),
        "elevation": round(float(np.radians(viewpoint.elevation_deg)), 5),
        "distance": round(viewpoint.distance / cube.half, 5),
        "focal": round(float(1 / np.tan(np.radians(FIELD_OF_VIEW_DEG) / 2)), 5),
    }


def _stills(shown: _Shown) -> str:
    """Return the scene from the first view, and from above without what is higher."""
    side, above = shown.viewpoint, shown.viewpoint.from_above()
    cut = max(1e-3, above.distance - 1.5 * shown.radius)
    pictures = [
        (_still(shown, side, 0.1 * side.distance), f"upright, from the side of {shown.photo}"),
        (_still(shown, above, cut), "from above; what is higher than the objects is cut away"),
    ]
    return "".join(
        figure(rgb, caption, f"The scene's points {caption}", 720) for rgb, caption in pictures
    )


def _still(shown: _Shown, viewpoint: Viewpoint, near: float) -> np.ndarray:
    drawing = Drawing(splatting=Splatting(near=near), neutral=BACKDROP)
    picture = render_scene(
        shown.bodies,
        shown.poses,
        thinned(shown.background, STILL_POINTS),
        viewpoint.camera_from_gv,
        intrinsics(STILL_SIZE),
        STILL_SIZE,
        drawing,
    )
    return picture.rgb
