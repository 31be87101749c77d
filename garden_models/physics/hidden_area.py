"""Tell where a surface is hidden by things on it from where it was seen to end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import ndimage

from garden_models.geometry.outline import Grid

Points = Float[np.ndarray, "n 3"]
Residual = Callable[[Points], Float[np.ndarray, " n"]]

MAX_CAMERAS = 24
MAX_POINTS = 60_000
BIN_DEG = 1.5
"""Side of the bins of directions in which the nearest point hides those behind it."""
BIN_DEPTH = 0.05
"""Relative depth within which the points of one bin are one surface."""


@dataclass(frozen=True)
class HiddenArea:
    """Rays from camera centres to the points that each of them sees, in GV."""

    centres: Float[np.ndarray, "c 3"]
    seen: tuple[Points, ...]
    points: Points

    @classmethod
    def seen_from(
        cls, points_gv: Points, camera_centres_gv: Float[np.ndarray, "c 3"]
    ) -> HiddenArea:
        """Find what each camera sees: in each bin of directions the nearest points.

        Where the cameras looked is not known, so a point behind a camera may count as
        seen; its ray starts at the camera and still meets nothing that hides it.
        """
        points = _spread(points_gv, MAX_POINTS)
        centres = _spread(camera_centres_gv, MAX_CAMERAS)
        return cls(centres, tuple(points[_nearest(points - c)] for c in centres), points)

    def hidden_cells(self, grid: Grid, residual: Residual, band: float) -> Bool[np.ndarray, "r c"]:
        """Return the (x, z) cells that things above the surface cover or hide.

        ``residual`` gives how far points lie below the surface (negative: above it), to
        within ``band``. A cell through which a camera saw something below is not hidden.
        """
        blocked = np.zeros(grid.shape, np.int64)
        passed = np.zeros(grid.shape, np.int64)
        for centre, seen in zip(self.centres, self.seen, strict=True):
            height = float(residual(centre[None])[0])
            if height >= -band:
                continue
            below = residual(seen)
            for votes, side in (
                (blocked, (below < -band) & (below > height)),
                (passed, below > band),
            ):
                rays = seen[side] - centre
                share = height / (height - below[side])
                hit = grid.count((centre + rays * share[:, None])[:, [0, 2]]) > 0
                np.add(votes, hit, out=votes)
        below = residual(self.points)
        covered = grid.count(self.points[below < -band][:, [0, 2]]) > 0
        near_passed = ndimage.maximum_filter(passed, 3)
        hidden = (covered | (ndimage.maximum_filter(blocked, 3) > near_passed)) & (passed == 0)
        return ndimage.binary_closing(hidden, np.ones((3, 3)))


def _nearest(rays: Points) -> Int[np.ndarray, " m"]:
    """Return the indices of the rays that are nearest in their bin of directions."""
    distance = np.linalg.norm(rays, axis=1)
    usable = distance > 0
    azimuth = np.degrees(np.arctan2(rays[:, 0], rays[:, 2]))
    with np.errstate(invalid="ignore", divide="ignore"):
        elevation = np.degrees(np.arcsin(np.clip(rays[:, 1] / distance, -1, 1)))
    width = int(360 / BIN_DEG) + 2
    column = np.floor((azimuth + 180) / BIN_DEG).astype(np.int64)
    row = np.floor((np.nan_to_num(elevation) + 90) / BIN_DEG).astype(np.int64)
    key = row * width + column
    nearest = np.full(int(key.max(initial=0)) + 1, np.inf)
    np.minimum.at(nearest, key[usable], distance[usable])
    return np.flatnonzero(usable & (distance <= nearest[key] * (1 + BIN_DEPTH)))


def _spread(rows: Float[np.ndarray, "n 3"], limit: int) -> Float[np.ndarray, "m 3"]:
    """Return at most ``limit`` rows, evenly picked."""
    if len(rows) <= limit:
        return rows
    return rows[np.linspace(0, len(rows) - 1, limit).astype(int)]
