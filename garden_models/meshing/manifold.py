"""Keep triangle surfaces closed: test it, and part places where a surface touches itself."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float, Int
from scipy.sparse.csgraph import connected_components

from garden_models.meshing.triangles import TriangleSurface

NUDGE = 0.05
"""Parted copies of a vertex move this share of the way to the middle of their own faces."""

ROUNDS = 6
"""Most passes; every one leaves fewer places where sheets touch."""

LEAST_VOLUME = 1e-4
"""Closed splinters under this share of the whole volume are dropped."""


def is_closed(faces: Int[np.ndarray, "f 3"]) -> bool:
    """Tell whether every directed edge has exactly one opposite: closed and orientable."""
    if len(faces) == 0:
        return False
    start = faces[:, [0, 1, 2]].ravel().astype(np.int64)
    end = faces[:, [1, 2, 0]].ravel().astype(np.int64)
    base = int(faces.max()) + 1
    forward = start * base + end
    unique = np.unique(forward)
    return len(unique) == len(forward) and np.array_equal(unique, np.unique(end * base + start))


def separate_touching(surface: TriangleSurface) -> TriangleSurface:
    """Part the surface along edges and at vertices where more than one sheet meets.

    Where four or more faces share an edge, the two that enclose the same piece of solid
    stay together; each sheet gets its own copy of the vertices, moved slightly into it. Two
    sheets that stay joined at both ends of an edge get midpoints of their own.
    """
    faces = _without_folded(np.asarray(surface.faces, np.int64))
    surface = TriangleSurface(surface.vertices.astype(float), faces)
    for _ in range(ROUNDS):
        if len(surface.faces) == 0:
            break
        surface = _part_vertices(surface)
        if is_closed(surface.faces):
            return _without_splinters(surface)
        surface = _split_doubled_edges(surface)
    return surface


def _part_vertices(surface: TriangleSurface) -> TriangleSurface:
    """Give every sheet its own copy of the vertices that sheets share."""
    faces = surface.faces
    first, second = _edge_partners(surface.vertices, faces)
    corner = _corner_groups(faces, first, second)
    count = int(corner.max()) + 1
    source = np.zeros(count, np.int64)
    source[corner] = faces.ravel()
    vertices = surface.vertices[source]
    shared = np.bincount(source, minlength=len(surface.vertices))[source] > 1
    middle = np.zeros((count, 3))
    np.add.at(middle, corner, np.repeat(surface.vertices[faces].mean(axis=1), 3, axis=0))
    middle /= np.bincount(corner, minlength=count)[:, None]
    vertices[shared] += NUDGE * (middle - vertices)[shared]
    return TriangleSurface(vertices, corner.reshape(-1, 3))


def _split_doubled_edges(surface: TriangleSurface) -> TriangleSurface:
    """Split each sheet's side of edges that two sheets share at a midpoint of its own."""
    faces, vertices = surface.faces, surface.vertices
    start, end = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    key = start * len(vertices) + end
    _, group, times = np.unique(key, return_inverse=True, return_counts=True)
    doubled = times[group.ravel()] > 1
    first, second = _edge_partners(vertices, faces)
    touched: set[int] = set()
    added: list[Float[np.ndarray, "3"]] = []
    cut: list[tuple[int, int, int]] = []
    for one, two in zip(first, second, strict=True):
        pair = (int(one) // 3, int(two) // 3)
        if not (doubled[one] or doubled[two]) or touched & set(pair):
            continue
        touched |= set(pair)
        new = len(vertices) + len(added)
        apex = [faces[half // 3, (half % 3 + 2) % 3] for half in (one, two)]
        middle = 0.5 * (vertices[start[one]] + vertices[end[one]])
        added.append(middle + NUDGE * (vertices[apex].mean(axis=0) - middle))
        for half, tip in zip((one, two), apex, strict=True):
            cut += [(start[half], new, tip), (new, end[half], tip)]
    rest = np.delete(faces, sorted(touched), axis=0)
    return TriangleSurface(
        np.concatenate([vertices, np.array(added).reshape(-1, 3)]),
        np.concatenate([rest, np.array(cut, np.int64).reshape(-1, 3)]),
    )


def _without_folded(faces: Int[np.ndarray, "f 3"]) -> Int[np.ndarray, "g 3"]:
    """Drop faces that use a vertex twice, and pairs of faces that lie on each other."""
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    if len(faces) == 0:
        return faces
    _, group = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True)
    swaps = (faces[:, [0, 1, 2]] > faces[:, [1, 2, 0]]).sum(axis=1)
    sign = np.where(swaps == 1, 1, -1)
    balance = np.bincount(group.ravel(), weights=sign)
    # Of each group of coincident faces the surplus direction survives, once.
    order = np.arange(len(faces))
    keep = np.zeros(len(faces), bool)
    for side in (1, -1):
        of_side = (sign == side) & (np.sign(balance[group.ravel()]) == side)
        _, index = np.unique(group.ravel()[of_side], return_index=True)
        keep[order[of_side][index]] = True
    return faces[keep]


def _edge_partners(
    vertices: Float[np.ndarray, "v 3"], faces: Int[np.ndarray, "f 3"]
) -> tuple[Int[np.ndarray, " m"], Int[np.ndarray, " m"]]:
    """Pair half-edges (index 3 * face + corner) that belong to one sheet."""
    start, end = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    low, high = np.minimum(start, end), np.maximum(start, end)
    key = low * (int(faces.max()) + 1) + high
    order = np.argsort(key, kind="stable")
    edge_start = np.flatnonzero(np.append(True, np.diff(key[order]) > 0))
    size = np.diff(np.append(edge_start, len(order)))
    simple = edge_start[size == 2]
    first, second = [order[simple]], [order[simple + 1]]
    for at, many in zip(edge_start[size > 2], size[size > 2], strict=True):
        pairs = _pair_around(vertices, faces, order[at : at + many], low, high, start)
        first.append(pairs[:, 0])
        second.append(pairs[:, 1])
    return np.concatenate(first), np.concatenate(second)


def _pair_around(
    vertices: Float[np.ndarray, "v 3"],
    faces: Int[np.ndarray, "f 3"],
    halves: Int[np.ndarray, " k"],
    low: Int[np.ndarray, " h"],
    high: Int[np.ndarray, " h"],
    start: Int[np.ndarray, " h"],
) -> Int[np.ndarray, "p 2"]:
    """Pair the half-edges of one edge so that each pair encloses solid."""
    a, b = vertices[low[halves[0]]], vertices[high[halves[0]]]
    axis = (b - a) / max(float(np.linalg.norm(b - a)), 1e-30)
    opposite = vertices[faces[halves // 3, (halves % 3 + 2) % 3]] - a
    side = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    angle = np.arctan2(opposite @ np.cross(axis, side), opposite @ side)
    turn = halves[np.argsort(angle, kind="stable")]
    along = start[turn] == low[turn]
    pairs: list[tuple[int, int]] = []
    taken: set[int] = set()
    # Turning about the axis, solid begins at a face that runs against the axis and ends at
    # the next one that runs along it.
    for i in np.flatnonzero(~along):
        for step in range(1, len(turn)):
            j = (i + step) % len(turn)
            if along[j] and int(j) not in taken:
                taken.add(int(j))
                pairs.append((int(turn[i]), int(turn[j])))
                break
    return np.array(pairs, np.int64).reshape(-1, 2)


def _corner_groups(
    faces: Int[np.ndarray, "f 3"], first: Int[np.ndarray, " m"], second: Int[np.ndarray, " m"]
) -> Int[np.ndarray, " c"]:
    """Return, for each corner (3 * face + i), the number of the vertex it belongs to."""
    start, end = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    following = 3 * (np.arange(3 * len(faces)) // 3) + (np.arange(3 * len(faces)) + 1) % 3
    opposite = start[first] == end[second]
    first, second = first[opposite], second[opposite]
    left = np.concatenate([first, following[first]])
    right = np.concatenate([following[second], second])
    count = 3 * len(faces)
    link = sp.csr_matrix((np.ones(len(left)), (left, right)), shape=(count, count))
    return connected_components(link, directed=False)[1].astype(np.int64)


def _without_splinters(surface: TriangleSurface) -> TriangleSurface:
    """Drop closed pieces of almost no volume and vertices that no face uses."""
    faces = surface.faces
    count = len(surface.vertices)
    sides = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    link = sp.csr_matrix((np.ones(len(sides)), sides.T), shape=(count, count))
    pieces, piece = connected_components(link, directed=False)
    a, b, c = (surface.vertices[faces[:, i]] for i in range(3))
    of_face = np.einsum("fi,fi->f", a, np.cross(b, c)) / 6.0
    volume = np.abs(np.bincount(piece[faces[:, 0]], weights=of_face, minlength=pieces))
    keep: Bool[np.ndarray, " p"] = volume > LEAST_VOLUME * volume.sum()
    faces = faces[keep[piece[faces[:, 0]]]]
    used, compact = np.unique(faces, return_inverse=True)
    return TriangleSurface(surface.vertices[used], compact.reshape(-1, 3))
