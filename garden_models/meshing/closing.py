"""Close a foreign mesh, so that it encloses a volume and has a mass.

A mesh that only has its vertices doubled (along the seams of a texture), sheets that touch or
small holes is mended as it is. One with large holes is made anew: a place is inside if most
rays from it meet the back of a face first (Nooruddin and Turk 2003, "Simplification and repair
of polygonal models"); the border of such places is closed, and is drawn onto the torn surface
near it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float, Int
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from garden_models.meshing.holes import border_edges, fill_holes
from garden_models.meshing.manifold import is_closed, separate_touching
from garden_models.meshing.ray_casting import RayCaster
from garden_models.meshing.surface import extract_surface
from garden_models.meshing.triangles import TriangleSurface, flipped, signed_volume
from garden_models.meshing.voxels import VoxelGrid
from garden_models.metrics.mesh import sample_surface
from garden_models.scene import BadGeometry

SAME_PLACE = 1e-6
"""Vertices nearer to each other than this share of the size are one."""

LEAST_PIECE = 0.01
"""Closed pieces under this share of the largest one's volume are crumbs."""

CELLS = 72
"""Cells along the longest side of the grid in which inside and outside are told apart."""

DIRECTIONS = 15
"""Rays from every cell; an odd number leaves no draw."""

SAMPLES = 120_000
"""Places on the torn surface that the closed one is drawn onto."""

DRAWN = 0.9
"""How far: not all of the way, so that no two vertices come to lie on each other."""


@dataclass(frozen=True)
class ClosedMesh:
    """A closed surface with outward faces, and whether it had to be made anew."""

    surface: TriangleSurface
    remade: bool


def close_mesh(vertices: Float[np.ndarray, "v 3"], faces: Int[np.ndarray, "f 3"]) -> ClosedMesh:
    """Return the mesh closed. Raises BadGeometry if it encloses nothing."""
    surface = fill_holes(_welded(np.asarray(vertices, float), np.asarray(faces, np.int64)))
    if not len(border_edges(surface.faces)):
        mended = separate_touching(surface)
        if is_closed(mended.faces):
            return ClosedMesh(_without_crumbs(_outward(mended)), remade=False)
    return ClosedMesh(_without_crumbs(_outward(_remade(_outward(surface)))), remade=True)


def _welded(vertices: Float[np.ndarray, "v 3"], faces: Int[np.ndarray, "f 3"]) -> TriangleSurface:
    """Join vertices at the same place and drop faces without an area."""
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    if not np.isfinite(size) or size == 0 or len(faces) == 0:
        raise BadGeometry("the mesh has no extent, so it encloses nothing")
    cells = np.rint((vertices - vertices.min(axis=0)) / (SAME_PLACE * size)).astype(np.int64)
    _, first, merged = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    faces = merged.reshape(-1)[faces]
    a, b, c = faces.T
    return TriangleSurface(vertices[first], faces[(a != b) & (b != c) & (c != a)])


def _outward(surface: TriangleSurface) -> TriangleSurface:
    return surface if signed_volume(surface) >= 0 else flipped(surface)


def _without_crumbs(surface: TriangleSurface) -> TriangleSurface:
    """Keep the pieces that are not tiny beside the largest."""
    piece = _pieces(surface)
    a, b, c = (surface.vertices[surface.faces[:, i]] for i in range(3))
    of_face = np.einsum("fi,fi->f", a, np.cross(b, c)) / 6.0
    volume = np.abs(np.bincount(piece, weights=of_face))
    extent = float(np.prod(np.maximum(np.ptp(surface.vertices, axis=0), 1e-30)))
    if not volume.max(initial=0.0) > 1e-6 * extent:
        raise BadGeometry("the mesh encloses no volume, so it has no mass")
    faces = surface.faces[(volume >= LEAST_PIECE * volume.max())[piece]]
    used, compact = np.unique(faces, return_inverse=True)
    return TriangleSurface(surface.vertices[used], compact.reshape(-1, 3))


def _pieces(surface: TriangleSurface) -> Int[np.ndarray, " f"]:
    """Return the number of the connected piece of every face."""
    faces, count = surface.faces, len(surface.vertices)
    sides = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    link = sp.csr_matrix((np.ones(len(sides)), sides.T), shape=(count, count))
    of_vertex = connected_components(link, directed=False)[1]
    return np.unique(of_vertex[faces[:, 0]], return_inverse=True)[1].reshape(-1)


def _remade(torn: TriangleSurface) -> TriangleSurface:
    """Return the closed border of what lies inside the torn surface."""
    low, high = torn.vertices.min(axis=0), torn.vertices.max(axis=0)
    spacing = float((high - low).max()) / CELLS
    grid = VoxelGrid.around(low - 2 * spacing, high + 2 * spacing, spacing)
    centres = grid.centres(np.arange(int(np.prod(grid.shape)))).astype(float)
    field = 0.5 - _inside_share(torn, centres).reshape(grid.shape)
    if not (field < 0).any():
        raise BadGeometry("the mesh is torn and encloses nothing, so it has no mass")
    closed = extract_surface(field, grid.origin_gv, spacing)
    samples = sample_surface(torn.vertices, torn.faces, SAMPLES)
    distance, nearest = cKDTree(samples).query(closed.vertices)
    near = (distance < spacing)[:, None]
    drawn = closed.vertices + DRAWN * np.where(near, samples[nearest] - closed.vertices, 0.0)
    return separate_touching(TriangleSurface(drawn, closed.faces))


def _inside_share(
    surface: TriangleSurface, points: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, " n"]:
    """Return the share of directions in which a point sees the back of a face first."""
    caster = RayCaster(surface.vertices, surface.faces)
    a, b, c = (surface.vertices[surface.faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    count = np.zeros(len(points))
    for direction in _directions():
        hits = caster.cast(points, np.tile(direction, (len(points), 1)))
        count += (hits.face >= 0) & (normal[hits.face] @ direction > 0)
    return count / DIRECTIONS


def _directions() -> Float[np.ndarray, "d 3"]:
    """Return unit vectors on a Fibonacci spiral."""
    i = np.arange(DIRECTIONS) + 0.5
    z = 1.0 - 2.0 * i / DIRECTIONS
    around = np.pi * (1.0 + np.sqrt(5.0)) * i
    radius = np.sqrt(1.0 - z**2)
    return np.stack([radius * np.cos(around), radius * np.sin(around), z], axis=1)
