"""Extract a closed triangle mesh from a signed field, smooth it and simplify it."""

from __future__ import annotations

import fast_simplification
import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float
from skimage.measure import marching_cubes

from garden_models.meshing.manifold import is_closed, separate_touching
from garden_models.meshing.triangles import TriangleSurface, flipped, signed_volume

SHRINK = 0.5
INFLATE = -0.53
"""Taubin's (1995) pair of smoothing factors: pass band 0.11, volume kept."""


def extract_surface(
    field: Float[np.ndarray, "x y z"], origin: Float[np.ndarray, "3"], spacing: float
) -> TriangleSurface:
    """Return the zero surface of ``field`` (positive outside), closed at the grid's border."""
    padded = np.pad(field.astype(np.float32), 1, constant_values=1.0)
    # Exact zeros would give triangles without area.
    padded[np.abs(padded) < 1e-4] = 1e-4
    vertices, faces, _, _ = marching_cubes(padded, 0.0, gradient_direction="ascent")
    vertices = origin + (vertices.astype(float) - 1.0) * spacing
    surface = TriangleSurface(vertices, faces.astype(np.int64))
    return surface if signed_volume(surface) > 0 else flipped(surface)


def smooth_surface(
    surface: TriangleSurface, steps: int, fixed_y: float | None = None
) -> TriangleSurface:
    """Smooth without shrinking; vertices at ``fixed_y`` keep their height."""
    average = _neighbour_average(surface)
    vertices = surface.vertices.copy()
    flat = _at_height(vertices, fixed_y)
    for _ in range(steps):
        for factor in (SHRINK, INFLATE):
            vertices = vertices + factor * (average @ vertices - vertices)
            if fixed_y is not None:
                vertices[flat, 1] = fixed_y
    return TriangleSurface(vertices, surface.faces)


def _at_height(vertices: Float[np.ndarray, "v 3"], height: float | None) -> Bool[np.ndarray, " v"]:
    if height is None:
        return np.zeros(len(vertices), bool)
    tolerance = 1e-4 * float(np.ptp(vertices, axis=0).max())
    return np.abs(vertices[:, 1] - height) < tolerance


def _neighbour_average(surface: TriangleSurface) -> sp.csr_matrix:
    count = len(surface.vertices)
    a = surface.faces[:, [0, 1, 2, 1, 2, 0]].ravel()
    b = surface.faces[:, [1, 2, 0, 0, 1, 2]].ravel()
    link = sp.csr_matrix((np.ones(len(a)), (a, b)), shape=(count, count))
    link.data[:] = 1.0
    degree = np.maximum(np.asarray(link.sum(axis=1)).ravel(), 1.0)
    return sp.diags(1.0 / degree) @ link


def simplify_surface(surface: TriangleSurface, target_faces: int) -> TriangleSurface:
    """Reduce to about ``target_faces`` by quadric collapses (Garland and Heckbert 1997).

    A result that is not closed is thrown away for a gentler one; at worst the surface
    itself is returned.
    """
    target = target_faces
    while target < len(surface.faces):
        vertices, faces = fast_simplification.simplify(
            surface.vertices.astype(np.float32),
            surface.faces.astype(np.int32),
            target_count=target,
            agg=5,
        )
        reduced = separate_touching(TriangleSurface(vertices.astype(float), faces))
        if is_closed(reduced.faces):
            return reduced
        target = int(target * 1.15) + 1
    return surface
