"""Make an object's mesh of what a model completes from its best photo (paper, section 3.2).

The model's mesh is upright by its own frame; it is brought to metres and to our upright object
frame, closed as far as the physics needs, thinned, and painted: its texture is baked into the
colours of vertices, which are put where the texture changes, since all that draws or exports a
mesh here works on those.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from garden_models.geometry.rigid import homogeneous, invert_rigid, transform_points
from garden_models.meshing.best_view import best_view, mesh_request
from garden_models.meshing.closing import close_mesh
from garden_models.meshing.colour import ColourSource, refine_for_colour
from garden_models.meshing.config import MeshObject
from garden_models.meshing.manifold import is_closed
from garden_models.meshing.mesh_model import CompleteMesh, MeshAnswer
from garden_models.meshing.native_pose import NativePose, judge_native_pose
from garden_models.meshing.object_view import object_views
from garden_models.meshing.painted_surface import PaintedSurface
from garden_models.meshing.surface import simplify_surface
from garden_models.meshing.triangles import TriangleSurface, vertex_normals
from garden_models.progress import Progress, silent
from garden_models.scene import (
    BadGeometry,
    GravityView,
    ObjectMasks,
    ObjectMesh,
    Reconstruction,
    Verdict,
)

LEAST_POINTS = 50
"""Fewer fused points of the object than this do not fix where it is."""

FOOT = 0.02
"""The footprint is what lies within this share of the height of the lowest point."""

SEEN_WITHIN = 0.05
"""A photo saw a vertex if its depth there differs by less than this share of the size."""


@dataclass(frozen=True)
class _Placed:
    """A model's mesh in metres and the upright object frame, and where it put it."""

    surface: TriangleSurface
    paint: PaintedSurface
    gv_from_object: Float[np.ndarray, "4 4"]
    remade: bool


def complete_mesh(
    reconstruction: Reconstruction,
    gravity_view: GravityView,
    masks: ObjectMasks,
    predict: CompleteMesh,
    config: MeshObject | None = None,
    progress: Progress = silent,
) -> ObjectMesh:
    """Return the completed mesh in the upright object frame (metres, y down).

    ``gv_from_object`` is the model's own pose, which may lean. Raises BadGeometry if too
    little of the object is seen, or the model's mesh encloses nothing.
    """
    config = config or MeshObject()
    name, points = masks.target.name, np.asarray(masks.points_gv.xyz, float)
    if len(points) < LEAST_POINTS:
        raise BadGeometry(
            f"object {name!r} has only {len(points)} points; photograph it from more sides or "
            "draw its box again"
        )
    index = best_view(reconstruction, masks)
    view = reconstruction.views[index]
    progress(0.0, f"completing {name} from {view.photo}")
    request = mesh_request(view, masks.masks[index], config.seed)
    answer = predict(request)
    gv_from_camera = gravity_view.gv_from_world @ invert_rigid(view.camera_from_world)
    progress(0.6, "closing the mesh")
    placed = _placed(answer, gv_from_camera, config)
    native = judge_native_pose(
        answer.vertices,
        answer.faces,
        answer.camera_from_mesh,
        gv_from_camera[:3, :3],
        request,
        view.K,
        points,
    )
    progress(0.8, "painting the mesh")
    surface = refine_for_colour(placed.surface, placed.paint, config.max_faces)
    rgb = placed.paint.sample(surface.vertices, vertex_normals(surface)).rgb
    observed = _observed(reconstruction, gravity_view, masks, surface, placed.gv_from_object)
    progress(1.0, f"mesh of {len(surface.faces)} faces")
    return ObjectMesh(
        name=name,
        vertices=surface.vertices.astype(np.float32),
        faces=surface.faces.astype(np.int32),
        vertex_rgb=np.clip(np.rint(rgb), 0, 255).astype(np.uint8),
        observed=observed,
        gv_from_object=placed.gv_from_object,
        watertight=is_closed(surface.faces),
        completion=(
            *_completion(config.method, view.photo, native, placed, answer),
            f"its vertices' colours miss the model's by {_missed(surface, placed, rgb):.1f} of "
            "255 on average between them",
        ),
        verdict=_verdict(native, name),
    )


def _placed(
    answer: MeshAnswer, gv_from_camera: Float[np.ndarray, "4 4"], config: MeshObject
) -> _Placed:
    """Bring the model's mesh to metres, its footprint's centre to the origin."""
    gv_from_mesh = gv_from_camera @ homogeneous(answer.camera_from_mesh)
    scale = float(np.cbrt(np.linalg.det(gv_from_mesh[:3, :3])))
    if not np.isfinite(scale) or scale <= 0:
        raise BadGeometry("the model's pose mirrors the mesh or has no scale")
    metres = np.asarray(answer.vertices, float) * scale
    closed = close_mesh(metres, answer.faces)
    foot = _foot(closed.surface.vertices)
    gv_from_object = np.eye(4)
    gv_from_object[:3, :3] = gv_from_mesh[:3, :3] / scale
    gv_from_object[:3, 3] = gv_from_object[:3, :3] @ foot + gv_from_mesh[:3, 3]
    surface = simplify_surface(closed.surface, config.geometry_faces)
    surface = TriangleSurface(surface.vertices - foot, surface.faces)
    surface.vertices[:, 1] = np.minimum(surface.vertices[:, 1], 0.0)
    paint = PaintedSurface(
        metres - foot, answer.faces, answer.vertex_rgb, answer.uv, answer.texture
    )
    return _Placed(surface, paint, gv_from_object, closed.remade)


def _foot(vertices: Float[np.ndarray, "v 3"]) -> Float[np.ndarray, "3"]:
    """Return the centre of the footprint's bounds, at the height of the lowest point."""
    low, high = vertices[:, 1].min(), vertices[:, 1].max()
    foot = vertices[vertices[:, 1] > high - FOOT * (high - low)]
    middle = 0.5 * (foot.min(axis=0) + foot.max(axis=0))
    return np.array([middle[0], high, middle[2]])


def _observed(
    reconstruction: Reconstruction,
    gravity_view: GravityView,
    masks: ObjectMasks,
    surface: TriangleSurface,
    gv_from_object: Float[np.ndarray, "4 4"],
) -> Bool[np.ndarray, " v"]:
    """Tell which vertices a photo saw, with the mesh where the model put it."""
    views = object_views(reconstruction, gravity_view, masks)
    there = TriangleSurface(transform_points(gv_from_object, surface.vertices), surface.faces)
    size = float(np.linalg.norm(np.ptp(surface.vertices, axis=0)))
    source = ColourSource(reconstruction, views, there, SEEN_WITHIN * size)
    return source.sample(there.vertices, vertex_normals(there)).observed


def _missed(surface: TriangleSurface, placed: _Placed, rgb: Float[np.ndarray, "v 3"]) -> float:
    """Return the mean difference of blended and painted colours in the middles of faces."""
    a, b, c = (surface.vertices[surface.faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    painted = placed.paint.sample((a + b + c) / 3, normal / np.maximum(area, 1e-20)[:, None])
    off = np.abs(painted.rgb - rgb[surface.faces].mean(axis=1)).mean(axis=1)
    return float((off * area).sum() / max(area.sum(), 1e-20))


def _completion(
    method: str, photo: str, native: NativePose, placed: _Placed, answer: MeshAnswer
) -> tuple[str, ...]:
    """Say what the model made and what was changed about it."""
    out = [
        f"shape and colours completed by {method} from photo {photo}",
        f"the model's own pose leans by {native.tilt_deg:.1f} degrees and covers the mask with "
        f"IoU {native.mask_iou:.2f}",
    ]
    if answer.texture is not None:
        out.append("its texture was baked into the colours of vertices")
    if placed.remade:
        out.append("it had holes and was closed anew where its surface ends")
    return tuple(out)


def _verdict(native: NativePose, name: str) -> Verdict:
    problems = native.problems(name)
    return Verdict("degraded" if problems else "ok", problems)
