"""Build the three objects as closed triangle meshes, z up, standing on z = 0, metres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .noise import Array

Faces = NDArray[np.int64]
Point = tuple[float, float]


@dataclass(frozen=True)
class Shape:
    """A closed mesh, z up, base on z = 0. ``smooth``: shade with vertex normals."""

    vertices: Array
    faces: Faces
    smooth: bool


def lathe(profile: Array, segments: int) -> Shape:
    """Turn ``profile`` rows (radius, height), bottom to top, around z into a closed mesh.

    The first and last rows must have a positive radius; both ends are closed by a disc.
    """
    angle = 2.0 * np.pi * np.arange(segments) / segments
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rows = len(profile)
    side = np.concatenate([np.column_stack([r * ring, np.full(segments, z)]) for r, z in profile])
    bottom, top = rows * segments, rows * segments + 1
    vertices = np.vstack([side, [0.0, 0.0, profile[0, 1]], [0.0, 0.0, profile[-1, 1]]])
    here = np.arange(segments)
    right = (here + 1) % segments
    faces = []
    for row in range(rows - 1):
        a, b = row * segments + here, row * segments + right
        faces += [np.stack([a, b, b + segments], 1), np.stack([a, b + segments, a + segments], 1)]
    faces.append(np.stack([np.full(segments, bottom), right, here], 1))
    last = (rows - 1) * segments
    faces.append(np.stack([np.full(segments, top), last + here, last + right], 1))
    return Shape(vertices, np.concatenate(faces), smooth=True)


def spline(knots: Array, samples: int) -> Array:
    """Return a Catmull-Rom curve through ``knots`` (n, 2), ``samples`` points a span."""
    padded = np.vstack([2 * knots[0] - knots[1], knots, 2 * knots[-1] - knots[-2]])
    t = np.linspace(0.0, 1.0, samples, endpoint=False)[:, None]
    spans = []
    for p0, p1, p2, p3 in zip(padded, padded[1:], padded[2:], padded[3:], strict=False):
        spans.append(
            0.5
            * (
                2 * p1
                + (p2 - p0) * t
                + (2 * p0 - 5 * p1 + 4 * p2 - p3) * t**2
                + (3 * p1 - p0 - 3 * p2 + p3) * t**3
            )
        )
    return np.vstack([*spans, knots[-1:]])


def jar() -> Shape:
    """Return a lidded ginger jar, 0.27 m high: rotationally symmetric."""
    body = spline(
        np.array(
            [
                *((0.062, 0.0), (0.068, 0.008), (0.088, 0.06), (0.098, 0.115), (0.086, 0.165)),
                *((0.062, 0.190), (0.056, 0.198)),
            ]
        ),
        6,
    )
    lid = spline(
        np.array(
            [
                *((0.064, 0.200), (0.068, 0.206), (0.066, 0.214), (0.048, 0.229), (0.022, 0.239)),
                *((0.015, 0.244), (0.021, 0.253), (0.020, 0.262), (0.010, 0.269), (0.003, 0.270)),
            ]
        ),
        4,
    )
    return lathe(np.vstack([body, lid]), segments=64)


def triangulate(polygon: list[Point]) -> list[tuple[int, int, int]]:
    """Cut a simple counter-clockwise polygon into triangles by clipping ears.

    Points on straight edges are kept as corners of triangles.
    """
    points = np.array(polygon)
    left = list(range(len(polygon)))
    triangles = []
    while len(left) > 3:
        best, best_quality = -1, 0.0
        for i in range(len(left)):
            a, b, c = (points[left[(i + d) % len(left)]] for d in (-1, 0, 1))
            area = cross2(b - a, c - b)
            others = [points[j] for j in left if j not in (left[i - 1], left[i])]
            others = [p for p in others if not np.allclose(p, c)]
            longest = max(np.sum((b - a) ** 2), np.sum((c - b) ** 2), np.sum((a - c) ** 2))
            quality = area / longest
            if quality > best_quality and not any(inside(p, a, b, c) for p in others):
                best, best_quality = i, quality
        if best < 0:
            raise ValueError("polygon has no ear: give it counter-clockwise and simple")
        n = len(left)
        triangles.append((left[best - 1], left[best], left[(best + 1) % n]))
        del left[best]
    return [*triangles, (left[0], left[1], left[2])]


def cross2(a: Array, b: Array) -> float:
    """Return the cross product of two plane vectors."""
    return float(a[0] * b[1] - a[1] * b[0])


def inside(p: Array, a: Array, b: Array, c: Array) -> bool:
    """Tell whether ``p`` lies in the triangle a, b, c or on its rim."""
    return min(cross2(b - a, p - a), cross2(c - b, p - b), cross2(a - c, p - c)) >= -1e-12


class Shell:
    """A closed surface put together from prisms along x and their end caps."""

    def __init__(self) -> None:
        self.corners: list[Array] = []

    def prism(self, polygon: list[Point], x0: float, x1: float) -> None:
        """Add the sides of ``polygon`` (y, z; counter-clockwise) swept from x0 to x1."""
        for (y0, z0), (y1, z1) in zip(polygon, polygon[1:] + polygon[:1], strict=True):
            a, b = (x0, y0, z0), (x0, y1, z1)
            c, d = (x1, y1, z1), (x1, y0, z0)
            self.corners += [np.array([a, c, d]), np.array([a, b, c])]

    def cap(self, polygon: list[Point], x: float, towards: int) -> None:
        """Add ``polygon`` at ``x`` facing +x (``towards`` 1) or -x (-1)."""
        for triangle in triangulate(polygon):
            corners = np.array([(x, *polygon[i]) for i in triangle])
            self.corners.append(corners[::towards])

    def shape(self) -> Shape:
        """Return the mesh with equal corners merged."""
        soup = np.concatenate(self.corners)
        vertices, index = np.unique(np.round(soup, 9), axis=0, return_inverse=True)
        return Shape(vertices, index.reshape(-1, 3).astype(np.int64), smooth=False)


def house() -> Shape:
    """Return a toy house with eaves, a chimney and a lean-to at one gable."""
    half, wall_x, overhang = 0.068, 0.095, 0.012
    ridge, slab, slope = 0.215, 0.014, 0.95
    eave = half + overhang
    c1, c2, chimney_top = 0.024, 0.050, 0.232
    a, a_low, a_high, lean = 0.045, 0.058, 0.076, 0.055

    def up(y: float) -> float:
        return ridge - slope * abs(y)

    def low(y: float) -> float:
        return up(y) - slab

    under: list[Point] = [(half, low(half)), (eave, low(eave)), (eave, up(eave))]
    roof: list[Point] = [(c2, up(c2)), (c1, up(c1)), (0.0, up(0.0)), (-eave, up(eave))]
    slab_section: list[Point] = [
        *[(-eave, low(eave)), (-half, low(half)), (0.0, low(0.0))],
        *under,
        *roof,
    ]
    foot: list[Point] = [(-half, 0.0), (-a, 0.0), (a, 0.0), (half, 0.0)]
    left: list[Point] = [(-eave, low(eave)), (-half, low(half))]
    body_section = [*foot, *under, *roof, *left]
    stack: list[Point] = [(c2, chimney_top), (c1, chimney_top)]
    chimney_section = [*foot, *under, roof[0], *stack, *roof[1:], *left]
    chimney: list[Point] = [roof[1], roof[0], *stack]
    gable: list[Point] = [*foot, under[0], (0.0, low(0.0)), left[1]]
    annex: list[Point] = [(-a, 0.0), (a, 0.0), (a, a_low), (-a, a_high)]
    gable_around_annex = [foot[0], annex[0], annex[3], annex[2], annex[1], *gable[3:]]

    shell = Shell()
    end = wall_x + overhang
    chimney_x = (0.020, 0.052)
    shell.prism(slab_section, -end, -wall_x)
    shell.cap(slab_section, -end, -1)
    shell.cap(gable, -wall_x, -1)
    shell.prism(body_section, -wall_x, chimney_x[0])
    shell.cap(chimney, chimney_x[0], -1)
    shell.prism(chimney_section, chimney_x[0], chimney_x[1])
    shell.cap(chimney, chimney_x[1], 1)
    shell.prism(body_section, chimney_x[1], wall_x)
    shell.cap(gable_around_annex, wall_x, 1)
    shell.prism(slab_section, wall_x, end)
    shell.cap(slab_section, end, 1)
    shell.prism(annex, wall_x, wall_x + lean)
    shell.cap(annex, wall_x + lean, 1)
    return shell.shape()
