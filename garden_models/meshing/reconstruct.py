"""Make an object's complete, closed, coloured mesh from all views that see it."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from garden_models.geometry.rigid import rigid
from garden_models.meshing.colour import (
    ColourSource,
    mirror_colours,
    refine_for_colour,
    spread_colours,
)
from garden_models.meshing.config import MeshObject
from garden_models.meshing.extent import rest_height
from garden_models.meshing.fusion import FusedVolume, fuse_volume
from garden_models.meshing.manifold import is_closed
from garden_models.meshing.object_view import object_views
from garden_models.meshing.standing import CONTACT_BANDS
from garden_models.meshing.surface import extract_surface, simplify_surface, smooth_surface
from garden_models.meshing.triangles import TriangleSurface, face_areas, vertex_normals
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

UNDERSIDE = 0.5
"""Faces whose outward normal points down by more than this are the underside."""


def mesh_object(
    reconstruction: Reconstruction,
    gravity_view: GravityView,
    masks: ObjectMasks,
    config: MeshObject | None = None,
    progress: Progress = silent,
) -> ObjectMesh:
    """Return the object's closed mesh in the upright object frame (metres, y down).

    Depth maps are fused inside the visual hull (Curless and Levoy 1996; Laurentini 1994),
    unseen places are closed at the support, by the hull and by mirror symmetry where the
    seen parts prove it. Raises BadGeometry if too little of the object is seen or if its
    views contradict each other.
    """
    config = config or MeshObject()
    views = object_views(reconstruction, gravity_view, masks)
    points = np.asarray(masks.points_gv.xyz, float)
    name = masks.target.name
    if not views or len(points) < LEAST_POINTS:
        raise BadGeometry(
            f"object {name!r} is seen in {len(views)} views with {len(points)} points; "
            "photograph it from more sides or draw its box again"
        )
    support = None if masks.support is None else float(masks.support.height_gv)
    rest = None if support is None else rest_height(points, support)
    volume = fuse_volume(
        views, points, rest, config, lambda share, doing: progress(0.7 * share, doing)
    )
    progress(0.7, "extracting the surface")
    surface = _shape(volume, rest, config)
    progress(0.8, "colouring the surface")
    source = ColourSource(
        reconstruction, views, surface, max(volume.truncation, 2 * volume.grid.spacing)
    )
    surface = refine_for_colour(surface, source, config.max_faces)
    colours = source.sample(surface.vertices, vertex_normals(surface))
    if volume.mirror is not None:
        colours = mirror_colours(surface, colours, volume.mirror, volume.truncation)
    gv_from_object = _object_frame(surface, rest)
    vertices = surface.vertices - gv_from_object[:3, 3]
    vertices[:, 1] = np.minimum(vertices[:, 1], 0.0)
    seen_share = _observed_share(surface, colours.observed)
    progress(1.0, f"mesh of {len(surface.faces)} faces, {seen_share:.0%} of it seen")
    return ObjectMesh(
        name=name,
        vertices=vertices.astype(np.float32),
        faces=surface.faces.astype(np.int32),
        vertex_rgb=spread_colours(surface, colours),
        observed=colours.observed,
        gv_from_object=gv_from_object,
        watertight=is_closed(surface.faces),
        completion=_completion(volume, support, rest, seen_share),
        verdict=_verdict(volume, masks, len(views), seen_share, config),
    )


def _shape(volume: FusedVolume, support: float | None, config: MeshObject) -> TriangleSurface:
    """Return the smoothed, simplified surface of the volume (GV)."""
    grid = volume.grid
    surface = extract_surface(volume.field, grid.origin_gv, grid.spacing)
    surface = smooth_surface(surface, config.smoothing_steps, support)
    surface = simplify_surface(surface, config.geometry_faces)
    if support is not None:
        vertices = surface.vertices.copy()
        near = vertices[:, 1] > support - 0.5 * grid.spacing
        vertices[near, 1] = support
        surface = TriangleSurface(vertices, surface.faces)
    return surface


def _object_frame(surface: TriangleSurface, support: float | None) -> Float[np.ndarray, "4 4"]:
    """Return ``gv_from_object``: axes of GV, origin under the centre of the footprint.

    The footprint is what lies within 2 % of the height of the lowest point; its centre is
    the middle of its bounds.
    """
    low, high = surface.vertices[:, 1].min(), surface.vertices[:, 1].max()
    foot = surface.vertices[surface.vertices[:, 1] > high - 0.02 * (high - low)]
    middle = 0.5 * (foot.min(axis=0) + foot.max(axis=0))
    height = high if support is None else max(support, high)
    return rigid(np.eye(3), np.array([middle[0], height, middle[2]]))


def _observed_share(surface: TriangleSurface, observed: Bool[np.ndarray, " v"]) -> float:
    """Return the share of the area, without the underside, that a photo saw."""
    area = face_areas(surface)
    a, b, c = (surface.vertices[surface.faces[:, i]] for i in range(3))
    down = np.cross(b - a, c - a)[:, 1] / np.maximum(2.0 * area, 1e-20)
    side = down < UNDERSIDE
    seen = observed[surface.faces].mean(axis=1)
    return float((area * seen)[side].sum() / max(area[side].sum(), 1e-20))


def _completion(
    volume: FusedVolume, support: float | None, rest: float | None, seen: float
) -> tuple[str, ...]:
    """Say how the unseen parts were closed."""
    out = [f"{seen:.0%} of the surface (without its underside) was seen in photos"]
    if support is not None and rest == support:
        out.append("underside closed flat at the support")
    elif rest is not None:
        out.append("underside closed flat at its lowest points, which lie under its support")
    if volume.foot > CONTACT_BANDS[0]:
        out.append(
            f"its lowest {volume.foot:.0%} were carried straight down to the support: what was "
            "seen of them is too small to stand on"
        )
    if volume.mirror is not None:
        out.append(
            "unseen parts completed by mirror symmetry in a vertical plane, which "
            f"{volume.mirror.score:.0%} of the checkable seen parts confirm"
        )
    if volume.back_limited:
        out.append(
            "views come from one side: the unseen back was closed at the reach of the seen points"
        )
    elif seen < 0.999:
        out.append("other unseen parts filled up to the silhouettes' hull")
    if volume.pieces > 1:
        out.append(f"{volume.pieces} separate pieces kept")
    return tuple(out)


def _verdict(
    volume: FusedVolume, masks: ObjectMasks, views: int, seen: float, config: MeshObject
) -> Verdict:
    reasons = []
    if seen < config.min_observed:
        reasons.append(
            f"only {seen:.0%} of the surface of {masks.target.name!r} was seen in photos; "
            "its other sides are guessed"
        )
    if volume.back_limited and volume.mirror is None and seen < config.min_observed_one_sided:
        reasons.append(
            f"{masks.target.name!r} was photographed from one side ({views} views); the depth "
            "of its unseen back is guessed"
        )
    if masks.support is None:
        reasons.append(
            f"nothing was found that {masks.target.name!r} stands on; its underside is guessed"
        )
    return Verdict("degraded" if reasons else "ok", tuple(reasons))
