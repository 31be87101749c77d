"""Split mesh edges while the mesh stays closed."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from garden_models.meshing.triangles import TriangleSurface


def unique_edges(
    faces: Int[np.ndarray, "f 3"],
) -> tuple[Int[np.ndarray, "e 2"], Int[np.ndarray, "f 3"]]:
    """Return the edges (lower vertex first) and, per face, those of corners 01, 12, 20."""
    sides = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
    base = int(faces.max()) + 1
    key, inverse = np.unique(sides[:, 0] * base + sides[:, 1], return_inverse=True)
    return np.stack([key // base, key % base], axis=1), inverse.reshape(-1, 3)


def split_edges(
    surface: TriangleSurface, marked: Bool[np.ndarray, " e"]
) -> tuple[TriangleSurface, Int[np.ndarray, "m 2"]]:
    """Split the ``marked`` edges (in the order of ``unique_edges``) at their midpoints.

    Faces are cut in two, three or four so that no gap opens. Returns the surface, its new
    vertices last, and the two old ends of each new vertex.
    """
    edges, of_face = unique_edges(surface.faces)
    ends = edges[marked]
    midpoint = np.full(len(edges), -1, np.int64)
    midpoint[marked] = len(surface.vertices) + np.arange(len(ends))
    vertices = np.concatenate([surface.vertices, surface.vertices[ends].mean(axis=1)])
    parts = []
    middle = midpoint[of_face]
    split = middle >= 0
    count = split.sum(axis=1)
    parts.append(surface.faces[count == 0])
    for turn in range(3):
        corners = np.roll(surface.faces, -turn, axis=1)
        mids = np.roll(middle, -turn, axis=1)
        flags = np.roll(split, -turn, axis=1)
        one = (count == 1) & flags[:, 0]
        parts += _cut_in_two(corners[one], mids[one])
        two = (count == 2) & flags[:, 0] & flags[:, 1]
        parts += _cut_in_three(corners[two], mids[two], vertices)
    every = count == 3
    parts += _cut_in_four(surface.faces[every], middle[every])
    return TriangleSurface(vertices, np.concatenate(parts)), ends


def _cut_in_two(corners: np.ndarray, mids: np.ndarray) -> list[np.ndarray]:
    a, b, c, m = corners[:, 0], corners[:, 1], corners[:, 2], mids[:, 0]
    return [np.stack([a, m, c], 1), np.stack([m, b, c], 1)]


def _cut_in_three(
    corners: np.ndarray, mids: np.ndarray, vertices: Float[np.ndarray, "v 3"]
) -> list[np.ndarray]:
    """Cut off the corner between the two split edges; halve the rest along its short way."""
    a, b, c, m, n = corners[:, 0], corners[:, 1], corners[:, 2], mids[:, 0], mids[:, 1]
    shorter = np.linalg.norm(vertices[a] - vertices[n], axis=1) <= np.linalg.norm(
        vertices[m] - vertices[c], axis=1
    )
    first = np.where(shorter[:, None], np.stack([a, m, n], 1), np.stack([a, m, c], 1))
    second = np.where(shorter[:, None], np.stack([a, n, c], 1), np.stack([m, n, c], 1))
    return [np.stack([m, b, n], 1), first, second]


def _cut_in_four(corners: np.ndarray, mids: np.ndarray) -> list[np.ndarray]:
    a, b, c = corners.T
    m, n, o = mids.T
    return [
        np.stack([a, m, o], 1),
        np.stack([m, b, n], 1),
        np.stack([o, n, c], 1),
        np.stack([m, n, o], 1),
    ]
