"""Draw coloured points as discs with a z-buffer, sized by the local point spacing.

Two passes (Botsch et al. 2005, "High-quality surface splatting on today's GPUs", without the
GPU): the first keeps the nearest depth of every pixel; the second averages the colours of all
discs within a depth tolerance of it, weighted towards their centres. A third pass in the
picture closes pinholes: pixels that see through a surface although nearly all pixels around
them see that surface (Rosenthal and Linsen 2008).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Int

from garden_models.geometry.rigid import transform_points
from garden_models.rendering.config import Splatting
from garden_models.rendering.pixel_ranges import expand_ranges
from garden_models.scene import PointCloud

DISCS_AT_ONCE = 1 << 18
"""Points expanded to pixels at a time (bounds memory)."""


@dataclass(frozen=True)
class SplatRaster:
    """A picture of points: colour 0..255, z-depth in metres (0: nothing seen), and the
    thickness in metres within which a depth of the picture is meant (its points' spacing).
    """

    rgb: Float32[np.ndarray, "h w 3"]
    depth: Float32[np.ndarray, "h w"]
    thickness: Float32[np.ndarray, "h w"]


@dataclass(frozen=True)
class _Discs:
    """Pixels of all discs: flat pixel, point index, weight 0..1."""

    pixel: Int[np.ndarray, " n"]
    point: Int[np.ndarray, " n"]
    weight: Float32[np.ndarray, " n"]


DEFAULT = Splatting()


def splat_points(
    points: PointCloud,
    camera_from_points: Float[np.ndarray, "r 4"],
    K: Float[np.ndarray, "3 3"],
    size: tuple[int, int],
    config: Splatting = DEFAULT,
) -> SplatRaster:
    """Draw ``points`` from a camera (OpenCV axes); ``size`` is (width, height) in pixels."""
    width, height = size
    xyz = transform_points(camera_from_points, points.xyz)
    index, pixels, radius = _seen_discs(xyz, points.spacing, K, size, config)
    discs = _expand_discs(index, pixels, radius, size)
    z = xyz[:, 2].astype(np.float32)
    nearest = np.full(height * width, np.inf, np.float32)
    np.minimum.at(nearest, discs.pixel, z[discs.point])

    slack = (config.blend_depth * points.spacing).astype(np.float32)
    front = z[discs.point] <= nearest[discs.pixel] + slack[discs.point]
    pixel, point, weight = discs.pixel[front], discs.point[front], discs.weight[front]
    values = np.concatenate(
        [points.rgb, z[:, None], points.spacing[:, None]], axis=1, dtype=np.float32
    )
    total = np.bincount(pixel, weight, height * width)
    sums = np.stack(
        [np.bincount(pixel, weight * values[point, i], height * width) for i in range(5)], axis=1
    )
    seen = total > 0
    means = np.zeros((height * width, 5), np.float32)
    means[seen] = sums[seen] / total[seen, None]
    picture = means.reshape(height, width, 5)
    for step in range(1, config.pinhole_px + 1):
        picture = _close_pinholes(picture, step, config.blend_depth)
    return SplatRaster(
        np.ascontiguousarray(picture[..., :3]),
        np.ascontiguousarray(picture[..., 3]),
        np.ascontiguousarray(picture[..., 4]),
    )


def _seen_discs(
    xyz: Float[np.ndarray, "n 3"],
    spacing: Float[np.ndarray, " n"],
    K: Float[np.ndarray, "3 3"],
    size: tuple[int, int],
    config: Splatting,
) -> tuple[Int[np.ndarray, " m"], Float[np.ndarray, "m 2"], Float[np.ndarray, " m"]]:
    """Return the points whose discs touch the picture, their pixels and radii in pixels."""
    width, height = size
    index = np.flatnonzero(xyz[:, 2] >= config.near)
    front = xyz[index]
    pixels = (front / front[:, 2:]) @ K[:2].T
    focal = float(np.sqrt(abs(K[0, 0] * K[1, 1])))
    radius = np.clip(
        config.radius * spacing[index] * focal / front[:, 2],
        config.least_radius_px,
        max(config.most_radius * width, config.least_radius_px),
    )
    inside = ((pixels > -radius[:, None]) & (pixels < radius[:, None] + (width, height))).all(1)
    return index[inside], pixels[inside], radius[inside]


def _expand_discs(
    index: Int[np.ndarray, " m"],
    pixels: Float[np.ndarray, "m 2"],
    radius: Float[np.ndarray, " m"],
    size: tuple[int, int],
) -> _Discs:
    """List all pixels whose centres lie in the discs."""
    width, height = size
    parts: list[_Discs] = []
    for start in range(0, len(index), DISCS_AT_ONCE):
        part = slice(start, start + DISCS_AT_ONCE)
        x, y, r = pixels[part, 0], pixels[part, 1], radius[part]
        first = np.maximum(np.ceil(y - r - 0.5), 0).astype(np.int64)
        last = np.minimum(np.floor(y + r - 0.5), height - 1).astype(np.int64)
        disc, row = expand_ranges(first, last)
        dy2 = (row + 0.5 - y[disc]) ** 2
        half = np.sqrt(np.maximum(r[disc] ** 2 - dy2, 0.0))
        first = np.maximum(np.ceil(x[disc] - half - 0.5), 0).astype(np.int64)
        last = np.minimum(np.floor(x[disc] + half - 0.5), width - 1).astype(np.int64)
        line, column = expand_ranges(first, last)
        owner = disc[line]
        distance2 = (column + 0.5 - x[owner]) ** 2 + dy2[line]
        # A steep bell, never quite zero so that a rim pixel still has a colour.
        weight = ((1.02 - distance2 / r[owner] ** 2) ** 3).astype(np.float32)
        parts.append(_Discs(row[line] * width + column, index[part][owner], weight))
    if not parts:
        return _Discs(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0, np.float32))
    return _Discs(
        np.concatenate([part.pixel for part in parts]),
        np.concatenate([part.point for part in parts]),
        np.concatenate([part.weight for part in parts]),
    )


def _close_pinholes(
    picture: Float32[np.ndarray, "h w 5"], step: int, blend_depth: float
) -> Float32[np.ndarray, "h w 5"]:
    """Fill pixels that lie behind at least six of the eight pixels ``step`` away.

    Channels are r, g, b, depth, thickness. The neighbours that count are those of the nearest
    surface: within its thickness of the third nearest of the eight.
    """
    height, width, _ = picture.shape
    padded = np.pad(picture, ((step, step), (step, step), (0, 0)))
    around = np.stack(
        [
            padded[step + dy : step + dy + height, step + dx : step + dx + width]
            for dy in (-step, 0, step)
            for dx in (-step, 0, step)
            if (dy, dx) != (0, 0)
        ]
    )
    depth = np.where(around[..., 3] > 0, around[..., 3], np.inf)
    own = np.where(picture[..., 3] > 0, picture[..., 3], np.inf)
    sixth = np.partition(depth, 5, axis=0)[5]
    with np.errstate(invalid="ignore"):
        # Two slacks: the surface around may slant by one, the pinhole is behind by the other.
        behind = own > sixth + 2 * blend_depth * np.median(around[..., 4], axis=0)
        use = (depth <= sixth) & behind
    weight = use.astype(np.float32)
    filled = (around * weight[..., None]).sum(axis=0) / np.maximum(weight.sum(axis=0), 1)[..., None]
    return np.where(behind[..., None], filled, picture).astype(np.float32)
