"""Read what each view says of directions, without its appearance: surfaces and line segments.

A view's evidence is a fixed number of surface normals with their places, and of line segments
lifted to the planes through the camera. Nothing of it depends on the unit of length or on
where the world's origin is once it has become tokens.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from garden_models.geometry.camera import camera_centre
from garden_models.geometry.depth_normals import depth_normals
from garden_models.gravity.reference_view import reference_view
from garden_models.gravity.vanishing_points import Segments, lift_segments
from garden_models.scene import BadGeometry, BadInput, Reconstruction, View

SURFACES = 256
LINES = 96
GRID = 48
"""Longest side of the grid on which a view's normals are read."""
MOST_VIEWS = 24
_ORTHONORMAL = 1e-3


@dataclass(frozen=True)
class ViewEvidence:
    """Evidence of the ``v`` views of a scene, in its world; ``reference`` is a view's index.

    ``normal`` (unit, towards the camera) is that of the surface at ``place``; ``line`` is the
    unit normal of the plane through a segment and its camera, ``line_sigma`` its error in
    radians. Rows of weight 0 are padding.
    """

    rotation: Float[np.ndarray, "v 3 3"]
    centre: Float[np.ndarray, "v 3"]
    place: Float[np.ndarray, "v p 3"]
    normal: Float[np.ndarray, "v p 3"]
    normal_weight: Float[np.ndarray, "v p"]
    line: Float[np.ndarray, "v s 3"]
    line_sigma: Float[np.ndarray, "v s"]
    line_weight: Float[np.ndarray, "v s"]
    reference: int

    def __len__(self) -> int:
        return len(self.rotation)


def read_evidence(reconstruction: Reconstruction) -> ViewEvidence:
    """Return the evidence of at most ``MOST_VIEWS`` views, spread evenly, the reference among
    them.

    Raises BadGeometry without views, BadInput for cameras that are not rotations, intrinsics
    that are not in pixels, or depth that is not finite.
    """
    if not reconstruction.views:
        raise BadGeometry("the reconstruction has no view; no photo could be registered")
    for view in reconstruction.views:
        check_view(view)
    reference = reference_view(reconstruction)
    count = len(reconstruction.views)
    chosen = sorted({int(k) for k in np.linspace(0, count - 1, min(count, MOST_VIEWS)).round()})
    if reference not in chosen:
        chosen[int(np.argmin(np.abs(np.array(chosen) - reference)))] = reference
    views = tuple(reconstruction.views[k] for k in sorted(chosen))
    segments = lift_segments(replace(reconstruction, views=views))
    surfaces = [depth_normals(v.depth, v.K, v.camera_from_world, GRID) for v in views]
    return gather(
        np.stack([v.camera_from_world for v in views]),
        surfaces,
        segments,
        sorted(chosen).index(reference),
    )


def gather(
    camera_from_world: Float[np.ndarray, "v r 4"],
    surfaces: list[tuple[np.ndarray, np.ndarray]],
    segments: Segments,
    reference: int,
) -> ViewEvidence:
    """Return evidence from each view's (places, normals) and the segments of all views.

    Of more surfaces than fit, evenly spaced ones are kept, of more segments the heaviest.
    """
    count = len(camera_from_world)
    place, normal = np.zeros((2, count, SURFACES, 3))
    normal_weight = np.zeros((count, SURFACES))
    line, line_sigma = np.zeros((count, LINES, 3)), np.ones((count, LINES))
    line_weight = np.zeros((count, LINES))
    for k, (places, normals) in enumerate(surfaces):
        keep = np.linspace(0, len(places) - 1, min(len(places), SURFACES)).round().astype(int)
        place[k, : len(keep)], normal[k, : len(keep)] = places[keep], normals[keep]
        normal_weight[k, : len(keep)] = 1.0
        own = np.flatnonzero(segments.view == k)
        own = own[np.argsort(-segments.weight[own], kind="stable")[:LINES]]
        line[k, : len(own)] = segments.normals_world[own]
        line_sigma[k, : len(own)] = segments.sigma_rad[own]
        line_weight[k, : len(own)] = segments.weight[own]
    return ViewEvidence(
        camera_from_world[:, :3, :3],
        np.stack([camera_centre(camera) for camera in camera_from_world]),
        place,
        normal,
        normal_weight,
        line,
        line_sigma,
        line_weight,
        reference,
    )


def check_view(view: View) -> None:
    """Raise BadInput for a view that is not what this program calls a view."""
    rotation = view.camera_from_world[:3, :3]
    off = np.abs(rotation @ rotation.T - np.eye(3)).max()
    if not (off < _ORTHONORMAL and np.linalg.det(rotation) > 0):
        raise BadInput(
            f"the camera of {view.photo} holds no rotation (its rows are off by {off:.3g}): give "
            "camera_from_world without scale, in OpenCV axes"
        )
    if not np.isfinite(view.camera_from_world).all():
        raise BadInput(f"the camera of {view.photo} holds values that are not finite")
    if not (np.isfinite(view.K).all() and min(view.K[0, 0], view.K[1, 1]) > 2):
        raise BadInput(
            f"the focal length of {view.photo} is {view.K[0, 0]:.3g}: give K in pixels of its rgb"
        )
    if not np.isfinite(view.depth).all() or (view.depth < 0).any():
        raise BadInput(
            f"the depth of {view.photo} has values that are negative or not finite: mark pixels "
            "without depth by 0"
        )
