"""Turn the outline of a raised support into convex prisms that things can stand on."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float
from scipy.spatial import ConvexHull

from garden_models.geometry.outline import signed_area
from garden_models.physics.convex_pieces import hull_piece
from garden_models.scene import ConvexPiece

NEARLY_CONVEX = 0.9
"""Share of its hull that an outline fills from which on the hull stands for it: outlines of
reconstructed surfaces are ragged by more than this."""

RAGGEDNESS = 0.02
"""Detail of a concave outline, relative to its extent, that its convex parts need not follow."""


def convex_hull_2d(points: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "k 2"]:
    """Return the convex hull of points in the plane, counter-clockwise."""
    return points[ConvexHull(points).vertices]


def support_prisms(
    outline_gv: Float[np.ndarray, "k 2"], height_gv: float, thickness_m: float
) -> tuple[ConvexPiece, ...]:
    """Return convex prisms in GV whose tops form the outline at ``height_gv``.

    The prisms reach ``thickness_m`` downwards (+y). Slivers thinner than a thousandth of the
    outline are left out.
    """
    thinnest = min(thickness_m, 1e-3 * float(np.ptp(outline_gv, axis=0).max())) / 2
    prisms = []
    for part in convex_parts(outline_gv):
        top = np.stack([part[:, 0], np.full(len(part), height_gv), part[:, 1]], axis=1)
        bottom = top + np.array([0.0, thickness_m, 0.0])
        prism = hull_piece(np.concatenate([top, bottom]), thinnest)
        if prism is not None:
            prisms.append(prism)
    return tuple(prisms)


def convex_parts(outline: Float[np.ndarray, "k 2"]) -> tuple[Float[np.ndarray, "m 2"], ...]:
    """Cut a simple polygon into convex ones (ear clipping, then merging over diagonals)."""
    hull = convex_hull_2d(outline)
    if abs(signed_area(outline)) >= NEARLY_CONVEX * signed_area(hull):
        return (hull,)
    points = _smoothed(outline if signed_area(outline) > 0 else outline[::-1])
    parts = [list(triangle) for triangle in _ears(points)]
    merged = True
    while merged:
        merged = False
        for i in range(len(parts)):
            for j in range(i + 1, len(parts)):
                joined = _join(points, parts[i], parts[j])
                if joined is not None:
                    parts[i] = joined
                    del parts[j]
                    merged = True
                    break
            if merged:
                break
    return tuple(points[part] for part in parts)


def _smoothed(outline: Float[np.ndarray, "k 2"]) -> Float[np.ndarray, "m 2"]:
    """Drop the detail of an outline (Douglas-Peucker)."""
    tolerance = RAGGEDNESS * float(np.ptp(outline, axis=0).max())
    offset = outline.mean(axis=0)
    kept = cv2.approxPolyDP((outline - offset).astype(np.float32), tolerance, True)[:, 0]
    return outline if len(kept) < 3 else kept.astype(np.float64) + offset


def _turn(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> float:
    """Return twice the signed area of a triangle."""
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def _ears(points: Float[np.ndarray, "k 2"]) -> list[tuple[int, int, int]]:
    """Triangulate a counter-clockwise simple polygon by clipping ears."""
    left = list(range(len(points)))
    ears: list[tuple[int, int, int]] = []
    while len(left) > 3:
        best = None
        for i, b in enumerate(left):
            a, c = left[i - 1], left[(i + 1) % len(left)]
            if _turn(points[a], points[b], points[c]) <= 0:
                continue
            others = points[[k for k in left if k not in (a, b, c)]]
            inside = np.ones(len(others), bool)
            for p, q in ((a, b), (b, c), (c, a)):
                edge = points[q] - points[p]
                offset = others - points[p]
                inside &= edge[0] * offset[:, 1] - edge[1] * offset[:, 0] >= 0
            if not inside.any():
                best = i
                break
        if best is None:  # self-touching outline: the rest is a sliver
            break
        a, b, c = left[best - 1], left[best], left[(best + 1) % len(left)]
        ears.append((a, b, c))
        del left[best]
    if len(left) == 3:
        ears.append((left[0], left[1], left[2]))
    return ears


def _join(points: Float[np.ndarray, "k 2"], p: list[int], q: list[int]) -> list[int] | None:
    """Return the union of two convex parts that share an edge, if it is convex too."""
    for i, a in enumerate(p):
        b = p[(i + 1) % len(p)]
        if a in q and b in q and q[(q.index(b) + 1) % len(q)] == a:
            start = q.index(a)
            ring = [a] + [q[(start + k) % len(q)] for k in range(1, len(q) - 1)]
            joined = p[: i + 1] + ring[1:] + p[i + 1 :]
            corners = points[joined]
            turns = [
                _turn(corners[k - 1], corners[k], corners[(k + 1) % len(joined)])
                for k in range(len(joined))
            ]
            if min(turns) >= 0:
                return joined
    return None
