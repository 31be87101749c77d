"""Fill the small holes of a triangle surface."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from garden_models.meshing.triangles import TriangleSurface

SMALL = 0.3
"""Holes with a border shorter than this share of the size are filled."""


def border_edges(faces: Int[np.ndarray, "f 3"]) -> Int[np.ndarray, "e 2"]:
    """Return the directed edges that belong to a single face."""
    if len(faces) == 0:
        return np.zeros((0, 2), np.int64)
    start, end = faces.ravel().astype(np.int64), faces[:, [1, 2, 0]].ravel().astype(np.int64)
    key = np.minimum(start, end) * (int(faces.max()) + 1) + np.maximum(start, end)
    _, group, count = np.unique(key, return_inverse=True, return_counts=True)
    lonely = count[group.reshape(-1)] == 1
    return np.stack([start[lonely], end[lonely]], axis=1)


def fill_holes(surface: TriangleSurface) -> TriangleSurface:
    """Close every small hole with triangles to the middle of its border.

    Borders that touch themselves are left open.
    """
    size = float(np.linalg.norm(np.ptp(surface.vertices, axis=0)))
    middles: list[Float[np.ndarray, "3"]] = []
    caps: list[Int[np.ndarray, "k 3"]] = []
    for loop in _loops(border_edges(surface.faces)):
        border = surface.vertices[loop]
        length = np.linalg.norm(np.roll(border, -1, axis=0) - border, axis=1).sum()
        if length > SMALL * size:
            continue
        middle = np.full(len(loop), len(surface.vertices) + len(middles))
        middles.append(border.mean(axis=0))
        # The cap runs along the border against the face that is there.
        caps.append(np.stack([np.roll(loop, -1), loop, middle], axis=1))
    if not caps:
        return surface
    return TriangleSurface(
        np.concatenate([surface.vertices, np.array(middles)]),
        np.concatenate([surface.faces, *caps]),
    )


def _loops(edges: Int[np.ndarray, "e 2"]) -> list[Int[np.ndarray, " k"]]:
    """Return closed chains of edges, each vertex once."""
    following: dict[int, int] = {}
    branching: set[int] = set()
    for start, end in edges.tolist():
        if start in following:
            branching.add(start)
        following[start] = end
    loops: list[Int[np.ndarray, " k"]] = []
    while following:
        first, at = following.popitem()
        chain = [first]
        while at in following:
            chain.append(at)
            at = following.pop(at)
        if at == first and not branching & set(chain):
            loops.append(np.array(chain))
    return loops
