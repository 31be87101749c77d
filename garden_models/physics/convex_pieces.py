"""Make convex colliders of a closed mesh: its hull where that is close, else several pieces."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import ConvexHull, QhullError

from garden_models.physics.config import Convexity
from garden_models.physics.decomposition import cut_boxes
from garden_models.physics.inertia import solid_properties
from garden_models.scene import BadGeometry, ConvexPiece


def convex_pieces(
    vertices: Float[np.ndarray, "v 3"],
    faces: Int[np.ndarray, "f 3"],
    noise_m: float = 0.0,
    config: Convexity = Convexity(),
    focus: Float[np.ndarray, "n 3"] | None = None,
) -> tuple[ConvexPiece, ...]:
    """Return convex pieces that together approximate a closed mesh, largest first.

    ``vertices`` are upright (y down), in metres; ``noise_m`` is their noise, which is not
    cut out. Pieces are finer around the ``focus`` points (where another object touches).
    Raises BadGeometry if the mesh is flat, so that it has no convex piece.
    """
    thinnest = config.thinnest * float(np.ptp(vertices, axis=0).max())
    if hull_piece(vertices, thinnest) is None:
        raise BadGeometry("the mesh is flat, so nothing can collide with it: mesh it again")
    hulls = [
        hull_piece(points, thinnest)
        for points in cut_boxes(vertices, faces, noise_m, config.cutting, focus)
    ]
    pieces = [_with_few_vertices(hull, config) for hull in hulls if hull is not None]
    volumes = [solid_properties(piece.vertices, piece.faces).volume for piece in pieces]
    return tuple(pieces[i] for i in np.argsort(volumes)[::-1])


def hull_piece(points: Float[np.ndarray, "n 3"], thinnest: float) -> ConvexPiece | None:
    """Return the convex hull with outward faces, or None if it is thinner than ``thinnest``."""
    points = np.unique(np.asarray(points, np.float64), axis=0)
    if len(points) < 4:
        return None
    centred = points - points.mean(axis=0)
    _, _, axes = np.linalg.svd(centred, full_matrices=False)
    if np.ptp(centred @ axes.T, axis=0).min() < thinnest:
        return None
    try:
        hull = ConvexHull(points)
    except QhullError:
        return None
    corner = points[hull.simplices]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    inward = np.einsum("fi,fi->f", normal, hull.equations[:, :3]) < 0
    faces = np.where(inward[:, None], hull.simplices[:, ::-1], hull.simplices)
    used, renumbered = np.unique(faces, return_inverse=True)
    return ConvexPiece(points[used], renumbered.reshape(-1, 3).astype(np.int32))


def _with_few_vertices(hull: ConvexPiece, config: Convexity) -> ConvexPiece:
    """Keep the vertices of a hull that stick out most in evenly spread directions."""
    if len(hull.vertices) <= config.most_hull_vertices:
        return hull
    spread = _even_directions(config.most_hull_vertices - 6)
    directions = np.concatenate([np.eye(3), -np.eye(3), spread])
    chosen = np.unique((hull.vertices @ directions.T).argmax(axis=0))
    reduced = hull_piece(hull.vertices[chosen], 0.0)
    return hull if reduced is None else reduced


def _even_directions(count: int) -> Float[np.ndarray, "n 3"]:
    """Return unit vectors on a Fibonacci sphere."""
    i = np.arange(count) + 0.5
    z = 1 - 2 * i / count
    radius = np.sqrt(1 - z**2)
    angle = np.pi * (1 + 5**0.5) * i
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)
