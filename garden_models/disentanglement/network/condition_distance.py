"""Measure points against the condition: distance, side and normal of the nearest triangle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

from garden_models.disentanglement.training.pair import Condition

CANDIDATES = 4
"""Triangles compared for each point: those of its nearest samples."""


@dataclass(frozen=True)
class ToCondition:
    """How points lie to the mesh.

    ``distance`` in metres; ``towards`` the unit vector from the nearest surface point (zero
    on the surface); ``normal`` that of its triangle.
    """

    distance: Float[np.ndarray, " n"]
    towards: Float[np.ndarray, "n 3"]
    normal: Float[np.ndarray, "n 3"]


def to_condition(points: Float[np.ndarray, "n 3"], condition: Condition) -> ToCondition:
    """Return how each point lies to the nearest of the condition's triangles."""
    _, index = cKDTree(condition.points).query(points, k=CANDIDATES)
    best = np.full(len(points), np.inf)
    nearest, chosen = np.zeros((len(points), 3)), np.zeros(len(points), np.int64)
    for k in range(CANDIDATES):
        candidate = closest_on_triangles(points, condition.triangles[index[:, k]])
        squared = np.square(points - candidate).sum(axis=1)
        better = squared < best
        best = np.where(better, squared, best)
        nearest[better] = candidate[better]
        chosen[better] = index[better, k]
    distance = np.sqrt(best)
    offset = points - nearest
    towards = offset / np.maximum(distance, 1e-9)[:, None]
    return ToCondition(distance, towards, normals(condition.triangles)[chosen])


def normals(triangles: Float[np.ndarray, "t 3 3"]) -> Float[np.ndarray, "t 3"]:
    """Return unit normals (zero where a triangle has no area)."""
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return np.asarray(cross / np.maximum(np.linalg.norm(cross, axis=1, keepdims=True), 1e-20))


def closest_on_triangles(
    points: Float[np.ndarray, "n 3"], triangles: Float[np.ndarray, "n 3 3"]
) -> Float[np.ndarray, "n 3"]:
    """Return the point of each triangle that is nearest to its point.

    It is the foot on the plane where that lies inside, else the nearest of the three edges'.
    """
    a, ab, ac = (
        triangles[:, 0],
        triangles[:, 1] - triangles[:, 0],
        triangles[:, 2] - triangles[:, 0],
    )
    ap = points - a
    d00, d01, d11 = (_dot(p, q) for p, q in ((ab, ab), (ab, ac), (ac, ac)))
    d20, d21 = _dot(ap, ab), _dot(ap, ac)
    scale = np.maximum(d00 * d11 - d01 * d01, 1e-30)
    v, w = (d11 * d20 - d01 * d21) / scale, (d00 * d21 - d01 * d20) / scale
    inside = (v >= 0) & (w >= 0) & (v + w <= 1) & (d00 * d11 - d01 * d01 > 1e-24)
    best = a + v[:, None] * ab + w[:, None] * ac
    nearest = np.where(inside, 0.0, np.inf)
    for k in range(3):
        start = triangles[:, k]
        edge = triangles[:, (k + 1) % 3] - start
        at = np.clip(_dot(points - start, edge) / np.maximum(_dot(edge, edge), 1e-30), 0, 1)
        foot = start + at[:, None] * edge
        squared = np.square(points - foot).sum(axis=1)
        better = ~inside & (squared < nearest)
        nearest = np.where(better, squared, nearest)
        best[better] = foot[better]
    return best


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.asarray(np.einsum("ni,ni->n", a, b))
