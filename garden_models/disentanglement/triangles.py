"""Sample triangles, and find the nearest point on them."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

Triangles = Float[np.ndarray, "t 3 3"]


def sample_triangles(
    corners: Triangles, count: int, rng: np.random.Generator
) -> tuple[Float[np.ndarray, "n 3"], Int[np.ndarray, " n"]]:
    """Draw points from triangles in proportion to area; return them and their triangles."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    cumulated = np.cumsum(area)
    which = np.searchsorted(cumulated, rng.uniform(0, cumulated[-1], count), side="right")
    which = np.minimum(which, len(corners) - 1)
    u, v = rng.uniform(0, 1, (2, count, 1))
    outside = u + v > 1
    u, v = np.where(outside, 1 - u, u), np.where(outside, 1 - v, v)
    return a[which] + u * (b - a)[which] + v * (c - a)[which], which


def normals(triangles: Triangles) -> Float[np.ndarray, "t 3"]:
    """Return unit normals (zero where a triangle has no area)."""
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return np.asarray(cross / np.maximum(np.linalg.norm(cross, axis=1, keepdims=True), 1e-20))


def closest_on_triangles(
    points: Float[np.ndarray, "n 3"], triangles: Float[np.ndarray, "n 3 3"]
) -> Float[np.ndarray, "n 3"]:
    """Return the point of each triangle that is nearest to its point.

    It is the foot on the plane where that lies inside, else the nearest of the three edges'.
    """
    a = triangles[:, 0]
    ab, ac, ap = triangles[:, 1] - a, triangles[:, 2] - a, points - a
    d00, d01, d11 = _dot(ab, ab), _dot(ab, ac), _dot(ac, ac)
    d20, d21 = _dot(ap, ab), _dot(ap, ac)
    scale = d00 * d11 - d01 * d01
    safe = np.maximum(scale, 1e-30)
    v, w = (d11 * d20 - d01 * d21) / safe, (d00 * d21 - d01 * d20) / safe
    inside = (v >= 0) & (w >= 0) & (v + w <= 1) & (scale > 1e-24)
    best = a + v[:, None] * ab + w[:, None] * ac
    left = np.flatnonzero(~inside)
    nearest = np.full(len(left), np.inf)
    for k in range(3):
        start = triangles[left, k]
        edge = triangles[left, (k + 1) % 3] - start
        at = _dot(points[left] - start, edge) / np.maximum(_dot(edge, edge), 1e-30)
        foot = start + np.clip(at, 0, 1)[:, None] * edge
        squared = np.square(points[left] - foot).sum(axis=1)
        better = squared < nearest
        nearest = np.where(better, squared, nearest)
        best[left[better]] = foot[better]
    return best


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.asarray(np.einsum("ni,ni->n", a, b))
