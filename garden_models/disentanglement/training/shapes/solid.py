"""Build closed solids from a few numbers: blocks, lathes, tubes, ellipsoids, prisms.

Everything here is in metres with y up; ``Shape`` turns it to the pipeline's y down.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

Points = Float[np.ndarray, "n 3"]
Numbers = Sequence[float] | np.ndarray


@dataclass(frozen=True)
class Solid:
    """A closed triangle mesh, faces counter-clockwise from outside."""

    vertices: Float[np.ndarray, "v 3"]
    faces: Int[np.ndarray, "f 3"]

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Solid:
        """Return it translated."""
        return Solid(self.vertices + np.array([x, y, z]), self.faces)

    def scaled(self, x: float, y: float, z: float) -> Solid:
        """Return it stretched along the axes (positive factors)."""
        return Solid(self.vertices * np.array([x, y, z]), self.faces)

    def turned(self, degrees: float, axis: int = 1) -> Solid:
        """Return it rotated about an axis through the origin (right-handed)."""
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        first, second = (axis + 1) % 3, (axis + 2) % 3
        rotation = np.eye(3)
        rotation[first, first] = rotation[second, second] = c
        rotation[first, second], rotation[second, first] = -s, s
        return Solid(self.vertices @ rotation.T, self.faces)


def merged(solids: Sequence[Solid]) -> Solid:
    """Return all solids as one mesh (they may overlap)."""
    starts = np.cumsum([0, *(len(solid.vertices) for solid in solids)])
    return Solid(
        np.concatenate([solid.vertices for solid in solids]),
        np.concatenate([s.faces + start for s, start in zip(solids, starts, strict=False)]),
    )


def block(low: Numbers, high: Numbers) -> Solid:
    """Return the axis-parallel box between two corners."""
    a, b = np.asarray(low, float), np.asarray(high, float)
    corners = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = [[q[i] for i in pick] for q in quads for pick in ((0, 1, 2), (0, 2, 3))]
    return Solid(a + corners * (b - a), np.array(faces))


def slab(width: float, height: float, depth: float, at: Numbers = (0, 0, 0)) -> Solid:
    """Return a box that stands on ``at``, the centre of its underside."""
    x, y, z = at
    return block((x - width / 2, y, z - depth / 2), (x + width / 2, y + height, z + depth / 2))


def lathe(profile: Sequence[tuple[float, float]], segments: int = 24) -> Solid:
    """Return the solid of revolution about y of a profile of (radius, height).

    The profile runs from the axis at the bottom along the outside, over the rim and, for a
    vessel, down the inside, back to the axis.
    """
    turn = np.arange(segments) * 2 * np.pi / segments
    rings = [
        np.stack([r * np.cos(turn), np.full(segments, h), -r * np.sin(turn)], axis=1)
        for r, h in profile
    ]
    here = np.arange(segments)
    there = (here + 1) % segments
    faces = []
    for level in range(len(rings) - 1):
        low, high = level * segments, (level + 1) * segments
        faces.append(np.stack([low + here, low + there, high + there], axis=1))
        faces.append(np.stack([low + here, high + there, high + here], axis=1))
    return _without_slivers(np.concatenate(rings), np.concatenate(faces))


def tube(
    path: Sequence[Sequence[float]] | np.ndarray, radius: float | Numbers, sides: int = 8
) -> Solid:
    """Return a round bar along a path of at least two points, closed at both ends."""
    points = np.asarray(path, float)
    radii = np.broadcast_to(np.asarray(radius, float), len(points))
    along = np.gradient(points, axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    across = _transported(along)
    turn = np.arange(sides) * 2 * np.pi / sides
    rings = [
        p + r * (np.cos(turn)[:, None] * u + np.sin(turn)[:, None] * np.cross(t, u))
        for p, r, t, u in zip(points, radii, along, across, strict=True)
    ]
    rings = [np.tile(points[0], (sides, 1)), *rings, np.tile(points[-1], (sides, 1))]
    here = np.arange(sides)
    there = (here + 1) % sides
    faces = []
    for level in range(len(rings) - 1):
        low, high = level * sides, (level + 1) * sides
        faces.append(np.stack([low + here, low + there, high + there], axis=1))
        faces.append(np.stack([low + here, high + there, high + here], axis=1))
    return _without_slivers(np.concatenate(rings), np.concatenate(faces))


def ellipsoid(
    radii: Numbers,
    at: Numbers = (0, 0, 0),
    squareness: float = 1.0,
    segments: int = 18,
) -> Solid:
    """Return an ellipsoid about ``at``; ``squareness`` below 1 makes it a rounded box."""
    rows = segments // 2 + 1
    polar = np.linspace(-np.pi / 2, np.pi / 2, rows)
    turn = np.arange(segments) * 2 * np.pi / segments

    def power(value: np.ndarray) -> np.ndarray:
        return np.asarray(np.sign(value) * np.abs(value) ** squareness)

    rings = [
        np.stack(
            [
                power(np.cos(p)) * power(np.cos(turn)),
                np.full(segments, power(np.sin(p))),
                -power(np.cos(p)) * power(np.sin(turn)),
            ],
            axis=1,
        )
        for p in polar
    ]
    here = np.arange(segments)
    there = (here + 1) % segments
    faces = []
    for level in range(rows - 1):
        low, high = level * segments, (level + 1) * segments
        faces.append(np.stack([low + here, low + there, high + there], axis=1))
        faces.append(np.stack([low + here, high + there, high + here], axis=1))
    unit = _without_slivers(np.concatenate(rings), np.concatenate(faces))
    return Solid(unit.vertices * np.asarray(radii) + np.asarray(at), unit.faces)


def prism(outline: Sequence[tuple[float, float]], depth: float) -> Solid:
    """Return a star-shaped outline (x, y; counter-clockwise) extruded along z, centred."""
    points = np.asarray(outline, float)
    n = len(points)
    centre = points.mean(axis=0)
    flat = np.concatenate([points, centre[None]])
    front = np.column_stack([flat, np.full(n + 1, depth / 2)])
    back = np.column_stack([flat, np.full(n + 1, -depth / 2)])
    here = np.arange(n)
    there = (here + 1) % n
    faces = [
        np.stack([here, there, np.full(n, n)], axis=1),
        np.stack([there, here, np.full(n, n)], axis=1) + n + 1,
        np.stack([here, here + n + 1, there + n + 1], axis=1),
        np.stack([here, there + n + 1, there], axis=1),
    ]
    return Solid(np.concatenate([front, back]), np.concatenate(faces))


def _transported(along: Points) -> Points:
    """Return unit vectors across a path that turn as little as they can."""
    start = np.eye(3)[int(np.argmin(np.abs(along[0])))]
    across = [start]
    for direction in along:
        u = across[-1] - direction * float(across[-1] @ direction)
        across.append(u / max(float(np.linalg.norm(u)), 1e-12))
    return np.array(across[1:])


def _without_slivers(vertices: Points, faces: Int[np.ndarray, "f 3"]) -> Solid:
    """Drop triangles without area: where a ring has radius zero."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return Solid(vertices, faces[area > 1e-12])
