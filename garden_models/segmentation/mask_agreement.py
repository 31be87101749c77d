"""Check a model's mask in one view against the object's points and the view's depth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import cKDTree

from garden_models.geometry.camera import pixel_rays
from garden_models.geometry.rigid import invert_rigid, transform_points
from garden_models.scene import PointCloud, View
from garden_models.segmentation.point_visibility import Sight

LEAST_HELD = 0.5
"""Least share of the points that the view shows which the mask must hold."""

LEAST_NEAR = 0.6
"""Least share of the mask's measured pixels that must lie near the object."""

NEAR = 0.6
"""Near is within this share of the object's size of its points: it has sides unseen so far."""

FEWEST = 8
"""From fewer points or pixels nothing is concluded."""

SAMPLES = 3000
"""About how many of the mask's pixels are compared."""


@dataclass(frozen=True)
class Agreement:
    """``held`` is the share of the shown points inside the mask, ``near`` the share of the
    mask's measured pixels near the object (NaN: too few to tell).
    """

    held: float
    near: float

    @property
    def ok(self) -> bool:
        """Whether one of them confirms the mask and neither contradicts it."""
        known = np.isfinite([self.held, self.near]).any()
        return bool(known) and not (self.held < LEAST_HELD or self.near < LEAST_NEAR)


def agreement(
    mask: Bool[np.ndarray, "h w"],
    view: View,
    sight: Sight,
    nodes: PointCloud,
    own: Bool[np.ndarray, " n"],
) -> Agreement:
    """Compare a mask with the ``own`` points among ``nodes`` that the view shows."""
    if not mask.any():
        return Agreement(0.0, float("nan"))
    shown = own & sight.visible
    held = float("nan")
    if shown.sum() >= FEWEST:
        held = float(mask.ravel()[sight.projection.flat[shown]].mean())
    return Agreement(held, _near(mask, view, sight, nodes.xyz[own]))


def _near(
    mask: Bool[np.ndarray, "h w"],
    view: View,
    sight: Sight,
    object_points: Float[np.ndarray, "n 3"],
) -> float:
    """Return the share of the mask's measured pixels whose points lie near the object's."""
    row, column = np.nonzero(mask & (view.depth > 0))
    if len(row) < FEWEST or len(object_points) < FEWEST:
        return float("nan")
    row, column = row[:: len(row) // SAMPLES + 1], column[:: len(column) // SAMPLES + 1]
    rays = pixel_rays(np.stack([column + 0.5, row + 0.5], 1), view.K)
    measured = transform_points(
        invert_rigid(sight.camera_from_points), rays * view.depth[row, column, None]
    )
    low, high = np.percentile(object_points, [2, 98], axis=0)
    reach = NEAR * float(np.linalg.norm(high - low))
    distance, _ = cKDTree(object_points).query(measured, distance_upper_bound=reach)
    return float(np.isfinite(distance).mean())
