"""Choose the reference view of the Gravity-View frame: the one that shares most with others."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from garden_models.geometry.camera import camera_centre, inside_image, project
from garden_models.scene import BadGeometry, Reconstruction, View

SAMPLE = 3000
SAME_DEPTH = 0.03
"""Relative depth difference up to which a point is the surface that the view sees."""


def sees(view: View, points_world: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, " n"]:
    """Tell which points the view sees: inside the picture and at its own depth there."""
    pixels, z = project(points_world, view.K, view.camera_from_world)
    seen = (z > 0) & inside_image(pixels, view.size)
    column, row = np.floor(pixels[seen]).astype(int).T
    depth = view.depth[row, column]
    seen[seen] = np.abs(depth - z[seen]) < SAME_DEPTH * z[seen]
    return seen


def reference_view(reconstruction: Reconstruction) -> int:
    """Return the index of the view whose points are seen by the most other views.

    Where no point is shared it is the view nearest to the cameras' mean centre.
    """
    views = reconstruction.views
    if not views:
        raise BadGeometry("the reconstruction has no view; no photo could be registered")
    points = reconstruction.points_world.xyz
    points = points[:: max(1, len(points) // SAMPLE)].astype(np.float64)
    seen = np.array([sees(view, points) for view in views], dtype=int).reshape(len(views), -1)
    shared = seen @ np.maximum(seen.sum(0) - 1, 0)
    if shared.any():
        return int(np.argmax(shared))
    centres = np.array([camera_centre(view.camera_from_world) for view in views])
    return int(np.argmin(np.linalg.norm(centres - centres.mean(0), axis=1)))
