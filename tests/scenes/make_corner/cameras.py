"""Walk around the table by hand: where each photo was taken, in the room frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .noise import Array
from .room import TABLE_HEIGHT, TABLE_LOW, TABLE_SIZE

WIDTH, HEIGHT = 768, 576
FOCAL_PX = 760.0

# Passes: first and last azimuth (degrees, from x towards y, seen from the table),
# elevation (degrees), distance (metres), photos.
PASSES = (
    (-48.0, 138.0, 24.0, 1.22, 13),
    (125.0, -35.0, 36.0, 1.18, 7),
    (-20.0, 112.0, 48.0, 1.16, 4),
)


@dataclass(frozen=True)
class Shot:
    """One photo: its name and ``room_from_camera`` (4x4, OpenCV camera)."""

    photo: str
    room_from_camera: Array


def intrinsics(width: int = WIDTH) -> Array:
    """Return K (3x3) for photos of ``width`` pixels, pixel centres at +0.5."""
    scale = width / WIDTH
    return np.array(
        [
            [FOCAL_PX * scale, 0, WIDTH * scale / 2],
            [0, FOCAL_PX * scale, HEIGHT * scale / 2],
            [0, 0, 1],
        ]
    )


def shots(seed: int = 4) -> list[Shot]:
    """Return the photos in the order in which they were taken."""
    rng = np.random.default_rng(seed)
    middle = np.array(
        [TABLE_LOW[0] + TABLE_SIZE[0] / 2, TABLE_LOW[1] + TABLE_SIZE[1] / 2, TABLE_HEIGHT + 0.08]
    )
    found: list[Shot] = []
    for first, last, elevation, distance, count in PASSES:
        for azimuth in np.linspace(first, last, count):
            az = np.radians(azimuth + rng.normal(0.0, 1.2))
            el = np.radians(elevation + rng.normal(0.0, 1.5))
            towards = np.array([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)])
            eye = middle + (distance + rng.normal(0.0, 0.03)) * towards
            look = middle + rng.normal(0.0, 0.02, 3)
            roll = np.radians(rng.normal(0.0, 1.5))
            found.append(Shot(f"corner_{len(found):02d}.jpg", looking(eye, look, roll)))
    return found


def looking(eye: Array, target: Array, roll: float) -> Array:
    """Return room_from_camera (4x4) at ``eye`` looking at ``target``, rolled (radians)."""
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    c, s = np.cos(roll), np.sin(roll)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([c * right + s * down, c * down - s * right, forward], axis=1)
    matrix[:3, 3] = eye
    return matrix
