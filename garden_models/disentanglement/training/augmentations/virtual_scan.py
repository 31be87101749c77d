"""Keep what virtual cameras see (paper: virtual multi-view scanning with a z-buffer)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import maximum_filter, minimum_filter

from garden_models.disentanglement.training.augmentations.config import VirtualScan
from garden_models.disentanglement.training.pair import LabelledCloud


@dataclass(frozen=True)
class Scan:
    """Which virtual camera (axis 0) sees which point, and how.

    ``depth`` is the z-depth in metres; ``near`` and ``far`` are the depths of the nearest and
    farthest surface within a pixel of the point's.
    """

    eye: Float[np.ndarray, "c 3"]
    visible: Bool[np.ndarray, "c n"]
    depth: Float[np.ndarray, "c n"]
    near: Float[np.ndarray, "c n"]
    far: Float[np.ndarray, "c n"]


def scan(points: Float[np.ndarray, "n 3"], rng: np.random.Generator, config: VirtualScan) -> Scan:
    """Look at a cloud from 25 to 45 cameras on an arc above it."""
    count = int(rng.integers(config.views[0], config.views[1] + 1))
    eye, rotation = trajectory(points, count, rng, config)
    camera = np.matmul(points[None] - eye[:, None], rotation.transpose(0, 2, 1))
    z = camera[..., 2]
    pixel, inside = _pixels(camera, config)
    buffer = np.full(count * config.image_px**2, np.inf)
    np.minimum.at(buffer, pixel[inside], z[inside])
    image = buffer.reshape(count, config.image_px, config.image_px)
    nearest = minimum_filter(image, size=(1, 3, 3), mode="nearest")
    farthest = maximum_filter(np.where(np.isfinite(image), image, -np.inf), size=(1, 3, 3))
    index = np.where(inside, pixel, 0)
    near, far = nearest.reshape(-1)[index], farthest.reshape(-1)[index]
    visible = inside & (z <= near * (1 + config.depth_tolerance))
    return Scan(eye, visible, z, near, far)


def keep_seen(
    cloud: LabelledCloud, seen: Scan, rng: np.random.Generator, config: VirtualScan
) -> Int[np.ndarray, " m"]:
    """Return the indices of points that enough cameras see, drawn by how many do."""
    views = seen.visible.sum(axis=0)
    enough = views >= config.least_views
    if enough.sum() < 0.05 * len(enough):  # hidden from nearly all: keep what anyone sees
        enough = views >= 1
    share = views / max(float(np.quantile(views[enough], 0.8)), 1.0) if enough.any() else views
    return np.flatnonzero(enough & (rng.random(len(views)) < share))


def trajectory(
    points: Float[np.ndarray, "n 3"], count: int, rng: np.random.Generator, config: VirtualScan
) -> tuple[Float[np.ndarray, "c 3"], Float[np.ndarray, "c 3 3"]]:
    """Return eyes and rotations (camera from world) on a swaying arc around the cloud."""
    low, high = points.min(axis=0), points.max(axis=0)
    centre, diagonal = (low + high) / 2, float(np.linalg.norm(high - low))
    at = np.linspace(0, 1, count)
    azimuth = rng.uniform(0, 2 * np.pi) + np.radians(rng.uniform(*config.arc_deg)) * at
    middle = rng.uniform(*config.elevation_deg)
    sway = rng.uniform(0, 20) * np.sin(2 * np.pi * (at * rng.uniform(0.5, 3) + rng.random()))
    elevation = np.radians(np.clip(middle + sway, *config.elevation_deg))
    distance = diagonal * rng.uniform(*config.distance) * rng.uniform(0.85, 1.15, count)
    out = np.stack(
        [
            np.cos(elevation) * np.cos(azimuth),
            -np.sin(elevation),
            np.cos(elevation) * np.sin(azimuth),
        ],
        axis=1,
    )
    eye = centre + distance[:, None] * out
    target = centre + rng.normal(0, 0.06 * diagonal, (count, 3))
    forward = target - eye
    forward /= np.linalg.norm(forward, axis=1, keepdims=True)
    right = np.cross(np.array([0.0, 1.0, 0.0]), forward)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    return eye, np.stack([right, np.cross(forward, right), forward], axis=1)


def _pixels(
    camera: Float[np.ndarray, "c n 3"], config: VirtualScan
) -> tuple[Int[np.ndarray, "c n"], Bool[np.ndarray, "c n"]]:
    """Return each point's pixel in the stack of images, and whether it is in its image."""
    px = config.image_px
    focal = px / 2 / np.tan(np.radians(config.field_of_view_deg) / 2)
    z = np.maximum(camera[..., 2], 1e-6)
    column = np.floor(focal * camera[..., 0] / z + px / 2)
    row = np.floor(focal * camera[..., 1] / z + px / 2)
    inside = (column >= 0) & (column < px) & (row >= 0) & (row < px) & (camera[..., 2] > 1e-6)
    flat = np.where(inside, row * px + column, 0).astype(np.int64)
    return flat + np.arange(len(camera))[:, None] * px * px, inside
