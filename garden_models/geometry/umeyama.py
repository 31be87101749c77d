"""Align two point sets by a similarity (Umeyama 1991)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float


def umeyama(
    points_a: Float[np.ndarray, "n 3"],
    points_b: Float[np.ndarray, "n 3"],
    *,
    with_scale: bool = True,
) -> tuple[float, Float[np.ndarray, "3 3"], Float[np.ndarray, "3"]]:
    """Return ``(scale, rotation, translation)`` with ``b ~ scale * rotation @ a + translation``.

    Raises ValueError for fewer than three points or points that all coincide.
    """
    if len(points_a) != len(points_b) or len(points_a) < 3:
        raise ValueError(
            f"umeyama needs two sets of the same 3 or more points, got {len(points_a)} "
            f"and {len(points_b)}"
        )
    mean_a, mean_b = points_a.mean(0), points_b.mean(0)
    centred_a, centred_b = points_a - mean_a, points_b - mean_b
    variance_a = (centred_a**2).sum() / len(points_a)
    if variance_a == 0:
        raise ValueError("umeyama cannot align points that all coincide")
    u, d, vt = np.linalg.svd(centred_b.T @ centred_a / len(points_a))
    sign = np.array([1.0, 1.0, np.sign(np.linalg.det(u) * np.linalg.det(vt))])
    rotation = (u * sign) @ vt
    scale = float((d * sign).sum() / variance_a) if with_scale else 1.0
    return scale, rotation, mean_b - scale * rotation @ mean_a
