"""Draw a cloud of points as a small picture, for pages that a person looks at."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, UInt8

BACKDROP = (250, 250, 248)
AZIMUTH_DEG, ELEVATION_DEG = 35.0, 28.0
SPLAT = 3

OBJECT_RGB, SCENE_RGB, MESH_RGB = (214, 96, 40), (96, 112, 130), (60, 150, 90)
HIT_RGB, WRONGLY_TAKEN_RGB, WRONGLY_KEPT_RGB = (214, 96, 40), (200, 30, 160), (20, 90, 220)


def cloud_picture(
    points: Float[np.ndarray, "n 3"],
    rgb: UInt8[np.ndarray, "n 3"],
    box: Float[np.ndarray, "2 3"],
    side: int = 300,
) -> UInt8[np.ndarray, "s s 3"]:
    """Return the points (y down) seen from above at an angle; ``box`` sets the scale."""
    centre, extent = box.mean(axis=0), float(np.linalg.norm(box[1] - box[0]))
    azimuth, elevation = np.radians(AZIMUTH_DEG), np.radians(ELEVATION_DEG)
    out = np.array(
        [
            np.cos(elevation) * np.cos(azimuth),
            -np.sin(elevation),
            np.cos(elevation) * np.sin(azimuth),
        ]
    )
    forward = -out
    right = np.cross(np.array([0.0, 1.0, 0.0]), forward)
    right /= np.linalg.norm(right)
    local = (points - centre) @ np.stack([right, np.cross(forward, right), forward]).T
    column, row = (local[:, :2] / extent * side * 0.98 + side / 2).astype(int).T
    near = (local[:, 2] - local[:, 2].min()) / max(float(np.ptp(local[:, 2])), 1e-9)
    shade = (1.1 - 0.45 * near)[:, None]
    colour = np.clip(rgb * shade, 0, 255).astype(np.uint8)
    picture = np.full((side, side, 3), BACKDROP, np.uint8)
    order = np.argsort(-local[:, 2], kind="stable")
    for dy in range(SPLAT):
        for dx in range(SPLAT):
            r, c = row[order] + dy - SPLAT // 2, column[order] + dx - SPLAT // 2
            inside = (r >= 0) & (r < side) & (c >= 0) & (c < side)
            picture[r[inside], c[inside]] = colour[order][inside]
    return picture


def by_label(label: Bool[np.ndarray, " n"]) -> UInt8[np.ndarray, "n 3"]:
    """Return the colours of object and scene points."""
    return np.where(label[:, None], OBJECT_RGB, SCENE_RGB).astype(np.uint8)


def by_outcome(
    claimed: Bool[np.ndarray, " n"], truth: Bool[np.ndarray, " n"]
) -> UInt8[np.ndarray, "n 3"]:
    """Return colours: rightly taken, wrongly taken, wrongly kept, rightly kept."""
    colour = np.full((len(truth), 3), SCENE_RGB, np.uint8)
    colour[claimed & truth] = HIT_RGB
    colour[claimed & ~truth] = WRONGLY_TAKEN_RGB
    colour[~claimed & truth] = WRONGLY_KEPT_RGB
    return colour
