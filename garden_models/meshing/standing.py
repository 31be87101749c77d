"""Make the field end on its support, on a foot on which the object can stand.

What is seen at rest stands: its centre of mass lies over its foot. Masks and depth are worst
where an object meets its support, so the foot may come out too small; it is then carried
down from higher up, by no more than needed.
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, Float

from garden_models.meshing.voxels import VoxelGrid

CONTACT_BANDS = (0.015, 0.03, 0.06, 0.12, 0.2, 0.3)
"""Shares of the height over which the foot is carried straight down, tried in this order."""

LEAST_TIPPING_DEG = 6.0
"""Tilt at which an object that stands safely would tip over; gravity is known to a few."""


def extend_below(
    target: Float[np.ndarray, "x y z"],
    trust: Float[np.ndarray, "x y z"],
    grid: VoxelGrid,
    support_height: float,
) -> None:
    """Copy the lowest layer under the support, so that smoothing does not round the foot."""
    below = layers_below(grid, support_height)
    if below.any() and not below.all():
        last = int(np.flatnonzero(~below)[-1])
        target[:, below] = target[:, last : last + 1]
        trust[:, below] = trust[:, last : last + 1]


def layers_below(grid: VoxelGrid, support_height: float) -> Bool[np.ndarray, " y"]:
    """Tell which horizontal layers lie at or under the support (y points down)."""
    return grid.origin_gv[1] + grid.spacing * np.arange(grid.shape[1]) >= support_height


def stand_on(
    field: Float[np.ndarray, "x y z"],
    grid: VoxelGrid,
    support_height: float,
    truncation: float,
) -> tuple[Float[np.ndarray, "x y z"], float]:
    """Carry the foot down to the support until the object stands, and cut it there.

    Returns the field (units of ``truncation``) and the share of the height that was carried
    down: the smallest one on which the object stands, else the smallest of all.
    """
    below = layers_below(grid, support_height)
    solid = np.flatnonzero((field < 0).any(axis=(0, 2)) & ~below)
    if not len(solid):
        return field, 0.0
    last = int(np.flatnonzero(~below)[-1])
    height = last - int(solid[0]) + 1
    first = None
    for share in CONTACT_BANDS:
        footed = _carried_down(field, last, max(2, round(share * height)), int(solid[0]))
        first = footed if first is None else first
        if tipping_angle_deg(footed[:, : last + 1]) >= LEAST_TIPPING_DEG:
            return _cut(footed, below, last, 0.5 * grid.spacing / truncation), share
    assert first is not None
    return _cut(first, below, last, 0.5 * grid.spacing / truncation), CONTACT_BANDS[0]


def tipping_angle_deg(field: Float[np.ndarray, "x y z"]) -> float:
    """Return by how much the solid (field < 0) can lean before it tips over its foot.

    The foot is the convex hull of the last layer along y; the density is uniform. Negative
    if it cannot stand at all, -90 if nothing touches the last layer.
    """
    solid = field < 0
    foot = np.argwhere(solid[:, -1]).astype(np.float32)
    if not len(foot):
        return -90.0
    mass = solid.sum()
    x, y, z = (
        float((np.arange(n) * solid.sum(axis=axes)).sum() / mass)
        for n, axes in zip(solid.shape, ((1, 2), (0, 2), (0, 1)), strict=True)
    )
    hull = cv2.convexHull(foot)
    inside = 0.5 + cv2.pointPolygonTest(hull, (x, z), measureDist=True)
    return float(np.degrees(np.arctan2(inside, solid.shape[1] - 0.5 - y)))


def _carried_down(
    field: Float[np.ndarray, "x y z"], last: int, band: int, highest: int
) -> Float[np.ndarray, "x y z"]:
    """Give the lowest ``band`` layers at least the section of the layer above them."""
    out = field.copy()
    top = last - band
    if top > highest and (field[:, top] < 0).any():
        out[:, top + 1 : last + 1] = np.minimum(out[:, top + 1 : last + 1], field[:, top : top + 1])
    return out


def _cut(
    field: Float[np.ndarray, "x y z"], below: Bool[np.ndarray, " y"], last: int, least: float
) -> Float[np.ndarray, "x y z"]:
    """Mirror the lowest layer's values, so that the zero crossing lies on the support."""
    field[:, below] = np.maximum(np.abs(field[:, last]), least)[:, None]
    return field
