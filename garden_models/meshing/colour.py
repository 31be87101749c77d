"""Colour vertices from the photos that see them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float, UInt8
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree

from garden_models.geometry.camera import project
from garden_models.meshing.mirror import MirrorPlane
from garden_models.meshing.object_view import ObjectView
from garden_models.meshing.ray_casting import RayCaster
from garden_models.meshing.subdivide import split_edges, unique_edges
from garden_models.meshing.triangles import TriangleSurface, vertex_normals
from garden_models.scene import Reconstruction

LEAST_COSINE = 0.2
"""Surfaces seen flatter than this (79 degrees) lend no colour."""

INTERIOR_PX = 2.0
"""Colours closer than this to the silhouette are mixed with what lies behind."""

BEST_VIEWS = 3
"""Colours are averaged over so few views that small misalignments do not blur them."""

OUTLIER = 45.0
"""Distance (of 255) from the median colour at which a view's colour is disbelieved."""


ROUNDS = 6
"""Most rounds of splitting: an edge is halved at most so often."""


@dataclass(frozen=True)
class VertexColours:
    """Colours (0..255, float), which vertices a photo saw, and which have a colour."""

    rgb: Float[np.ndarray, "v 3"]
    observed: Bool[np.ndarray, " v"]
    filled: Bool[np.ndarray, " v"]


class ColourSource:
    """Looks up the colours that the photos show at places of one surface (GV)."""

    def __init__(
        self,
        reconstruction: Reconstruction,
        views: Sequence[ObjectView],
        surface: TriangleSurface,
        tolerance: float,
    ) -> None:
        """``tolerance`` in metres: how far photo depth and surface may disagree."""
        self._views = views
        self._rgb = [reconstruction.views[view.index].rgb for view in views]
        self._caster = RayCaster(surface.vertices, surface.faces)
        self._tolerance = tolerance

    def sample(
        self, points_gv: Float[np.ndarray, "n 3"], normals_gv: Float[np.ndarray, "n 3"]
    ) -> VertexColours:
        """Return blended colours; those of unobserved points are 0."""
        colours = np.zeros((len(self._views), len(points_gv), 3), np.float32)
        weights = np.zeros((len(self._views), len(points_gv)), np.float32)
        for i, view in enumerate(self._views):
            pixels, weights[i] = self._weights(view, points_gv, normals_gv)
            colours[i] = _bilinear(self._rgb[i], pixels)
        return _blend(colours, weights)

    def _weights(
        self,
        view: ObjectView,
        points_gv: Float[np.ndarray, "n 3"],
        normals_gv: Float[np.ndarray, "n 3"],
    ) -> tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, " n"]]:
        """Return pixels and weights: 0 if hidden, else by angle, nearness and interior."""
        pixels, z = project(points_gv, view.K, view.camera_from_gv)
        height, width = view.mask.shape
        pixels = np.nan_to_num(pixels, nan=-1.0)
        inside = (pixels >= 0).all(axis=1) & (pixels[:, 0] < width) & (pixels[:, 1] < height)
        column = np.clip(pixels[:, 0], 0, width - 1).astype(int)
        row = np.clip(pixels[:, 1], 0, height - 1).astype(int)
        to_camera = view.centre_gv - points_gv
        distance = np.maximum(np.linalg.norm(to_camera, axis=1), 1e-12)
        cosine = (normals_gv * to_camera).sum(axis=1) / distance
        interior = np.clip(-view.outside_px[row, column] / INTERIOR_PX, 0.0, 1.0)
        usable = inside & view.mask[row, column] & (cosine > LEAST_COSINE)
        depth = view.depth[row, column]
        usable &= (depth == 0) | (np.abs(depth - z) < self._tolerance)
        usable[usable] &= ~self._hidden(points_gv[usable], normals_gv[usable], to_camera[usable])
        weight = (cosine * view.focal_px / distance) ** 2 * (interior + 0.02)
        return pixels, np.where(usable, weight, 0.0).astype(np.float32)

    def _hidden(
        self,
        points_gv: Float[np.ndarray, "n 3"],
        normals_gv: Float[np.ndarray, "n 3"],
        to_camera: Float[np.ndarray, "n 3"],
    ) -> Bool[np.ndarray, " n"]:
        lift = 0.25 * self._tolerance
        return self._caster.blocked(points_gv + lift * normals_gv, to_camera)


def _bilinear(
    rgb: UInt8[np.ndarray, "h w 3"], pixels: Float[np.ndarray, "n 2"]
) -> Float[np.ndarray, "n 3"]:
    """Return colours at pixel positions (centres at +0.5)."""
    height, width = rgb.shape[:2]
    x = np.clip(pixels[:, 0] - 0.5, 0, width - 1.001)
    y = np.clip(pixels[:, 1] - 0.5, 0, height - 1.001)
    column, row = x.astype(int), y.astype(int)
    dx, dy = (x - column)[:, None], (y - row)[:, None]
    picture = rgb.astype(np.float32)
    top = picture[row, column] * (1 - dx) + picture[row, column + 1] * dx
    bottom = picture[row + 1, column] * (1 - dx) + picture[row + 1, column + 1] * dx
    return (top * (1 - dy) + bottom * dy).astype(np.float32)


def _blend(
    colours: Float[np.ndarray, "views n 3"], weights: Float[np.ndarray, "views n"]
) -> VertexColours:
    """Average the best views' colours without those that differ from the median."""
    observed = weights.max(axis=0) > 0
    masked = np.where(weights[..., None] > 0, colours, np.nan)
    middle = np.zeros(colours.shape[1:], np.float32)
    middle[observed] = np.nanmedian(masked[:, observed], axis=0)
    odd = np.linalg.norm(colours - middle, axis=2) > OUTLIER
    trusted = np.where(odd, 1e-3 * weights, weights)
    rank = np.argsort(-trusted, axis=0, kind="stable")[:BEST_VIEWS]
    best = np.take_along_axis(trusted, rank, axis=0)
    chosen = np.take_along_axis(colours, rank[..., None], axis=0)
    share = best**2 / np.maximum((best**2).sum(axis=0), 1e-30)
    return VertexColours((chosen * share[..., None]).sum(axis=0), observed, observed)


class Colours(Protocol):
    """What knows the colours at places of a surface."""

    def sample(
        self, points: Float[np.ndarray, "n 3"], normals: Float[np.ndarray, "n 3"], /
    ) -> VertexColours:
        """Return the colours at points with outward normals."""
        ...


def refine_for_colour(
    surface: TriangleSurface, source: Colours, max_faces: int, least_error: float = 6.0
) -> TriangleSurface:
    """Split edges whose middle has another colour than the blend of its ends.

    The worst edges are split first, until ``max_faces`` is reached or no edge errs by more
    than ``least_error`` (of 255).
    """
    for _ in range(ROUNDS):
        edges, _ = unique_edges(surface.faces)
        normals = vertex_normals(surface)
        ends = source.sample(surface.vertices, normals)
        middles = source.sample(surface.vertices[edges].mean(axis=1), normals[edges].mean(axis=1))
        seen = middles.observed & ends.observed[edges].all(axis=1)
        error = np.linalg.norm(middles.rgb - ends.rgb[edges].mean(axis=1), axis=1)
        length = np.linalg.norm(np.diff(surface.vertices[edges], axis=1)[:, 0], axis=1)
        # An error matters as far as it reaches.
        cost = np.where(seen & (error > least_error), error * length, 0.0)
        # Every split edge adds two faces.
        budget = min((max_faces - len(surface.faces)) // 2, len(edges) // 6)
        marked = np.zeros(len(edges), bool)
        worst = np.argsort(-cost, kind="stable")[:budget]
        marked[worst[cost[worst] > 0]] = True
        if marked.sum() < 0.002 * len(edges):
            break
        surface, _ = split_edges(surface, marked)
    return surface


def mirror_colours(
    surface: TriangleSurface, colours: VertexColours, plane: MirrorPlane, reach: float
) -> VertexColours:
    """Give unobserved vertices the colour of an observed one within ``reach`` of their image.

    The two sides are rarely lit alike: the difference, known where both were seen, is spread
    smoothly over the rest and added (Perez et al. 2003). Coloured vertices stay marked as
    unobserved; those without a counterpart stay without a colour.
    """
    known = np.flatnonzero(colours.observed)
    if len(known) in (0, len(surface.vertices)):
        return colours
    distance, index = cKDTree(surface.vertices[known]).query(
        plane.reflect(surface.vertices), distance_upper_bound=reach
    )
    found = np.isfinite(distance)
    image = np.zeros_like(colours.rgb)
    image[found] = colours.rgb[known[index[found]]]
    both = found & colours.observed
    light = np.zeros(colours.rgb.shape)
    light[both] = colours.rgb[both] - image[both]
    if both.any():
        light[~both] = _dirichlet(_laplacian(surface), light, both)
    new = found & ~colours.observed
    rgb = np.where(new[:, None], np.clip(image + light, 0, 255), colours.rgb)
    return VertexColours(rgb, colours.observed, colours.filled | new)


def spread_colours(surface: TriangleSurface, colours: VertexColours) -> UInt8[np.ndarray, "v 3"]:
    """Give vertices without a colour smooth ones from those around them."""
    rgb = colours.rgb.astype(float)
    if not colours.filled.any():
        rgb[:] = 128.0
    elif not colours.filled.all():
        rgb[~colours.filled] = _dirichlet(_laplacian(surface), rgb, colours.filled)
    return np.clip(np.rint(rgb), 0, 255).astype(np.uint8)


def _laplacian(surface: TriangleSurface) -> sp.csr_matrix:
    """Return the graph Laplacian of the mesh's edges."""
    edges, _ = unique_edges(surface.faces)
    both = np.concatenate([edges, edges[:, ::-1]])
    count = len(surface.vertices)
    link = sp.csr_matrix((np.ones(len(both)), both.T), shape=(count, count))
    return (sp.diags(np.asarray(link.sum(axis=1)).ravel()) - link).tocsr()


def _dirichlet(
    laplacian: sp.csr_matrix, values: Float[np.ndarray, "v 3"], known: Bool[np.ndarray, " v"]
) -> Float[np.ndarray, "m 3"]:
    """Solve Laplace's equation; parts without any known vertex get the mean value."""
    unknown = np.flatnonzero(~known)
    mean = values[known].mean(axis=0)
    rows = laplacian[unknown]
    inner = rows[:, unknown] + 1e-6 * sp.identity(len(unknown))
    right = -rows[:, np.flatnonzero(known)] @ values[known] + 1e-6 * mean
    return np.asarray(spsolve(inner.tocsc(), right)).reshape(len(unknown), 3)
