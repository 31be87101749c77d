"""Find where the object can be: its bounds, and how far its unseen back may reach."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage

from garden_models.meshing.evidence import gather_evidence
from garden_models.meshing.object_view import ObjectView
from garden_models.meshing.voxels import VoxelGrid
from garden_models.scene import BadGeometry

COARSE = 64
"""Voxels along the longest side of the first, coarse grid."""

REACH = 0.35
"""How far the coarse grid reaches beyond the seen points, relative to their diagonal."""


HULL_SIDES = 160
"""Planes that bound the seen points, about 9 degrees apart."""

SUNKEN = 0.02
SUNKEN_POINTS = 0.02
"""The object reaches under its support if this share of its points lies this share of its
size below it."""


def robust_bounds(
    points_gv: Float[np.ndarray, "n 3"],
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """Return the box of the points without the outermost 0.5 % on each side."""
    low, high = np.percentile(points_gv, [0.5, 99.5], axis=0)
    return low, high


def rest_height(points_gv: Float[np.ndarray, "n 3"], support_height: float) -> float:
    """Return the y (GV, down) at which the object ends: its support, unless it reaches lower.

    A leaning or sunken seat lets parts of an object reach under the plane that was fitted to
    it; a few stray points do not.
    """
    size = float(np.linalg.norm(np.ptp(np.stack(robust_bounds(points_gv)), axis=0)))
    under = points_gv[:, 1] > support_height + SUNKEN * size
    if under.mean() < SUNKEN_POINTS:
        return support_height
    return float(np.percentile(points_gv[under, 1], 90))


def largest_gap_deg(views: Sequence[ObjectView], centre_gv: Float[np.ndarray, "3"]) -> float:
    """Return the widest angle about the object, seen from above, that holds no camera."""
    directions = np.stack([(view.centre_gv - centre_gv)[[0, 2]] for view in views])
    azimuth = np.sort(np.arctan2(directions[:, 1], directions[:, 0]))
    gaps = np.diff(np.append(azimuth, azimuth[0] + 2.0 * np.pi))
    return float(np.degrees(gaps.max()))


def coarse_hull(
    views: Sequence[ObjectView],
    points_gv: Float[np.ndarray, "n 3"],
    support_height: float | None,
    outvoted_share: float,
) -> tuple[VoxelGrid, Bool[np.ndarray, "x y z"]]:
    """Carve a coarse grid with the silhouettes; return it and what may be solid.

    ``support_height`` is the y (GV, down) under which nothing of the object lies. Raises
    BadGeometry if the silhouettes of the views have no common space.
    """
    low, high = robust_bounds(points_gv)
    reach = REACH * float(np.linalg.norm(high - low))
    low, high = low - reach, high + reach
    if support_height is not None:
        high[1] = min(high[1], support_height)
        low[1] = min(low[1], support_height - 1e-3 * reach)
    grid = VoxelGrid.around(low, high, float((high - low).max()) / (COARSE - 1))
    centres = grid.centres(np.arange(int(np.prod(grid.shape))))
    evidence = gather_evidence(centres, views, grid.spacing, outvoted_share, use_depth=False)
    # A voxel is kept if any part of it may be inside: half its diagonal is 0.87 spacings.
    solid = ((evidence.hull < 0.87 * grid.spacing) & (evidence.voters > 0)).reshape(grid.shape)
    if not solid.any():
        raise BadGeometry(
            "the object's masks do not agree on any place in space; check its box, or the "
            "photos' cameras"
        )
    return grid, _holding_points(grid, solid, points_gv)


def _holding_points(
    grid: VoxelGrid, solid: Bool[np.ndarray, "x y z"], points_gv: Float[np.ndarray, "n 3"]
) -> Bool[np.ndarray, "x y z"]:
    """Keep the pieces of the hull that hold a fair share of the object's points."""
    pieces, count = ndimage.label(solid, structure=np.ones((3, 3, 3)))
    flat, inside = grid.nearest(points_gv)
    held = np.bincount(pieces.ravel()[flat[inside]], minlength=count + 1)
    held[0] = 0
    if held.sum() == 0:
        sizes = np.bincount(pieces.ravel())
        sizes[0] = 0
        return pieces == int(sizes.argmax())
    return (held >= 0.05 * held.max())[pieces] & solid


def within_seen(
    points_gv: Float[np.ndarray, "n 3"],
    seen_gv: Float[np.ndarray, "m 3"],
    support_height: float | None,
    margin: float,
) -> Bool[np.ndarray, " n"]:
    """Tell which points lie in the convex hull of the seen ones and their foot on the support.

    ``margin`` in metres widens it. The hull is bounded by ``HULL_SIDES`` planes in evenly
    spread directions, which is a little larger and much cheaper than the exact one.
    """
    seen = seen_gv
    if support_height is not None:
        foot = seen.copy()
        foot[:, 1] = support_height
        seen = np.concatenate([seen, foot])
    directions = _spread_directions(HULL_SIDES)
    reach = (seen @ directions.T).max(axis=0) + margin
    parts = [
        (part.astype(float) @ directions.T <= reach).all(axis=1)
        for part in np.array_split(points_gv, len(points_gv) // 100_000 + 1)
    ]
    return np.concatenate(parts)


def _spread_directions(count: int) -> Float[np.ndarray, "n 3"]:
    """Return unit vectors on a Fibonacci spiral, with the six axes."""
    i = np.arange(count) + 0.5
    y = 1.0 - 2.0 * i / count
    around = np.pi * (1.0 + np.sqrt(5.0)) * i
    radius = np.sqrt(1.0 - y**2)
    spiral = np.column_stack([radius * np.cos(around), y, radius * np.sin(around)])
    return np.concatenate([spiral, np.eye(3), -np.eye(3)])
