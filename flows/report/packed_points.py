"""Pack coloured points into the few bytes that the page's viewer draws them from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from garden_models.scene import PointCloud


@dataclass(frozen=True)
class Cube:
    """The part of GV that is shown; its inside is -1..1 on each axis."""

    centre: Float[np.ndarray, "3"]
    half: float

    def to_unit(self, xyz: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        """Return the points' places in the cube."""
        return (xyz - self.centre) / self.half


@dataclass(frozen=True)
class Group:
    """Points that are shown or hidden together: ``name`` is the switch that does it."""

    name: str
    points: PointCloud


def cube_around(groups: list[Group]) -> Cube:
    """Return the cube around the middle 98 % of every group's points on each axis."""
    ranges = np.stack([np.percentile(g.points.xyz, [1, 99], axis=0) for g in groups])
    low, high = ranges[:, 0].min(axis=0), ranges[:, 1].max(axis=0)
    return Cube((low + high) / 2, max(float((high - low).max()) / 2 * 1.05, 1e-6))


def thinned(points: PointCloud, limit: int) -> PointCloud:
    """Return at most ``limit`` points, evenly picked, their spacing grown to match."""
    if len(points) <= limit:
        return points
    kept = points.subset(np.linspace(0, len(points) - 1, limit).astype(int))
    growth = np.sqrt(len(points) / limit)
    return PointCloud(kept.xyz, kept.rgb, kept.normal, kept.spacing * growth, kept.confidence)


def pack_points(groups: list[Group], cube: Cube) -> tuple[bytes, list[dict[str, Any]]]:
    """Pack the groups one after another: per point low bytes, high bytes and colour (9 bytes).

    Returns the bytes, and per group its name, first point, count, and the points' median
    spacing as a share of half the cube's side. Points outside of the cube are left out.
    """
    parts: list[np.ndarray] = []
    listed: list[dict[str, Any]] = []
    start = 0
    for group in groups:
        unit = cube.to_unit(group.points.xyz)
        inside = (np.abs(unit) <= 1).all(axis=1)
        if not inside.any():
            continue
        quantised = np.round((unit[inside] + 1) / 2 * 65535).astype(np.uint16)
        low, high = (quantised & 255).astype(np.uint8), (quantised >> 8).astype(np.uint8)
        parts.append(np.concatenate([low, high, group.points.rgb[inside]], axis=1))
        spacing = float(np.median(group.points.spacing[inside])) / cube.half
        count = len(quantised)
        listed.append({"name": group.name, "start": start, "count": count, "spacing": spacing})
        start += count
    return b"".join(part.tobytes() for part in parts), listed
