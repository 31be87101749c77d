"""Draw a polygon with fewer vertices, within a stated distance of the original."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float

from garden_models.geometry.outline import signed_area

Polygon = Float[np.ndarray, "k 2"]
HALVINGS = 5


def simplify_polygon(
    polygon: Polygon, tolerance: float, most_area_change: float = 0.01
) -> tuple[Polygon, float]:
    """Return the polygon with fewer of its vertices, and the tolerance that it keeps.

    No point of either outline is farther than the tolerance from the other (Douglas-Peucker).
    The tolerance is halved where the area would change by more than the share
    ``most_area_change`` or the outline would cross itself; after a few halvings the polygon
    stays as it is, at tolerance 0.
    """
    area = abs(signed_area(polygon))
    origin = polygon.mean(axis=0)  # OpenCV reckons in 32 bits: near zero they are finest
    for halving in range(HALVINGS + 1 if tolerance > 0 else 0):
        allowed = tolerance / 2**halving
        vertices = (polygon - origin).astype(np.float32)[:, None]
        simple = cv2.approxPolyDP(vertices, 0.999 * allowed, True)[:, 0].astype(np.float64) + origin
        change = abs(abs(signed_area(simple)) - area)
        if len(simple) >= 3 and change <= most_area_change * area and not crosses_itself(simple):
            return simple, allowed
    return polygon, 0.0


def crosses_itself(polygon: Polygon) -> bool:
    """Tell whether two edges that are no neighbours properly cross."""
    a, b = polygon, np.roll(polygon, -1, axis=0)
    one = _turns(a, b, a) * _turns(a, b, b) < 0
    return bool((one & one.T).any())


def _turns(a: Polygon, b: Polygon, point: Polygon) -> Float[np.ndarray, "k n"]:
    """Return for each edge a-b on which side each point lies: positive, negative, or 0."""
    edge = (b - a)[:, None]
    away = point[None] - a[:, None]
    side: Float[np.ndarray, "k n"] = edge[..., 0] * away[..., 1] - edge[..., 1] * away[..., 0]
    return side
