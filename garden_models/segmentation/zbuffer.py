"""Find which points a camera sees, by drawing them as small squares into a z-buffer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from garden_models.geometry.camera import project
from garden_models.scene import PointCloud

MOST_RADIUS_PX = 3


@dataclass(frozen=True)
class Projection:
    """Points in a picture: pixel (x, y), NaN behind the camera; z-depth; index of the flat
    pixel (-1 outside of the picture).
    """

    pixels: Float[np.ndarray, "n 2"]
    z: Float[np.ndarray, " n"]
    flat: Int[np.ndarray, " n"]


@dataclass(frozen=True)
class FrontPoints:
    """The nearest point of each pixel (-1: none) and its z-depth (inf: none)."""

    index: Int[np.ndarray, "h w"]
    z: Float[np.ndarray, "h w"]


def project_points(
    points: Float[np.ndarray, "n 3"],
    K: Float[np.ndarray, "3 3"],
    camera_from_points: Float[np.ndarray, "r 4"],
    size: tuple[int, int],
) -> Projection:
    """Project points into a picture of ``size`` = (width, height)."""
    pixels, z = project(points, K, camera_from_points)
    with np.errstate(invalid="ignore"):
        inside = (z > 0) & (pixels >= 0).all(1) & (pixels < np.array(size)).all(1)
    flat = np.full(len(points), -1)
    column, row = pixels[inside].astype(np.int64).T
    flat[inside] = row * size[0] + column
    return Projection(pixels, z, flat)


def front_points(
    cloud: PointCloud, seen: Projection, focal_px: float, size: tuple[int, int], growth: float = 1.0
) -> FrontPoints:
    """Draw each point as a square of its own spacing (times ``growth``); the nearest wins.

    Points outside of the picture are left out, also where their square would reach in.
    """
    width, height = size
    index = np.flatnonzero(seen.flat >= 0)
    index = index[np.argsort(-seen.z[index], kind="stable")]
    radius = np.ceil(0.5 * growth * focal_px * cloud.spacing[index] / seen.z[index] - 0.25)
    radius = np.clip(radius, 0, MOST_RADIUS_PX).astype(np.int64)
    # A border takes what squares draw past the picture; one more slot, what they do not draw.
    most = int(radius.max(initial=0))
    wide = width + 2 * most
    row, column = np.divmod(seen.flat[index], width)
    centre = (row + most) * wide + column + most
    steps = np.arange(-most, most + 1)
    offset = (steps[:, None] * wide + steps).ravel()
    ring = np.maximum(np.abs(steps[:, None]), np.abs(steps)).ravel()
    nowhere = wide * (height + 2 * most)
    slots = np.where(ring <= radius[:, None], centre[:, None] + offset, nowhere)
    # Far to near: of several points in one pixel the nearest is written last.
    front = np.full(nowhere + 1, -1)
    front[slots.ravel()] = np.repeat(index, len(offset))
    picture = front[:-1].reshape(height + 2 * most, wide)[most : most + height, most : most + width]
    z = np.append(seen.z, np.inf)[picture]
    return FrontPoints(np.ascontiguousarray(picture), z)
