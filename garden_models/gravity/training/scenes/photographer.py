"""Choose random cameras: orbits, walks and looks around; level, rolled, portrait, crooked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from garden_models.geometry.rigid import rigid
from garden_models.geometry.rotation import axis_angle
from garden_models.gravity.training.scenes.furnish import Room

FORWARD = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class PhotographerKind:
    """How many photos, and by how much all are rolled (None: as photographers do)."""

    photos: int | None = None
    roll_deg: float | None = None
    most_photos: int = 12


def random_cameras(
    room: Room, rng: np.random.Generator, kind: PhotographerKind = PhotographerKind()
) -> Float[np.ndarray, "v 4 4"]:
    """Return ``camera_from_room`` of a capture (OpenCV cameras, z-up room)."""
    count = kind.photos or int(rng.integers(2, kind.most_photos + 1))
    rolls = _rolls(count, rng, kind)
    poses = _orbit(room, count, rng) if rng.uniform() < 0.7 else _walk(room, count, rng)
    cameras = []
    for (centre, forward), roll in zip(poses, rolls, strict=True):
        rotation = axis_angle(FORWARD, roll) @ _level(forward)
        cameras.append(rigid(rotation, -rotation @ centre))
    return np.stack(cameras)


def _level(forward: np.ndarray) -> np.ndarray:
    """Return the rows of a level camera that looks ``forward``."""
    x = np.cross(forward, [0.0, 0.0, 1.0])
    if np.linalg.norm(x) < 1e-3:
        x = np.array([1.0, 0.0, 0.0])
    x = x / np.linalg.norm(x)
    return np.stack([x, np.cross(forward, x), forward])


def _rolls(count: int, rng: np.random.Generator, kind: PhotographerKind) -> np.ndarray:
    shake = rng.normal(0, np.radians(rng.uniform(0.3, 4.0)), count)
    if kind.roll_deg is not None:
        return np.radians(kind.roll_deg) + shake
    bias = rng.normal(0, np.radians(2.0))
    habit = rng.choice(
        ["level", "portrait", "mixed", "crooked", "upside down"], p=[0.68, 0.12, 0.07, 0.11, 0.02]
    )
    quarter = np.pi / 2 * rng.choice([-1, 1])
    base = {
        "level": np.zeros(count),
        "portrait": np.full(count, quarter),
        "mixed": quarter * rng.integers(0, 2, count),
        "crooked": np.full(count, rng.uniform(-np.pi, np.pi)),
        "upside down": np.full(count, np.pi),
    }[str(habit)]
    return np.asarray(base + bias + shake)


def _orbit(room: Room, count: int, rng: np.random.Generator) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return centres and view directions on an arc about the target."""
    arc = np.radians(rng.uniform(20, 330))
    first = rng.uniform(0, 2 * np.pi)
    pitch = np.radians(rng.uniform(8, 60) if room.close_up else rng.uniform(-8, 35))
    radius = rng.uniform(0.4, 1.3) if room.close_up else rng.uniform(0.9, 2.2)
    poses = []
    for k in range(count):
        azimuth = first + arc * k / max(count - 1, 1) + rng.normal(0, 0.05)
        own = float(np.clip(pitch + rng.normal(0, 0.1), -0.5, 1.45))
        away = np.array([np.cos(azimuth) * np.cos(own), np.sin(azimuth) * np.cos(own), np.sin(own)])
        centre = room.target + away * radius * rng.uniform(0.85, 1.15)
        centre[:2] = np.clip(centre[:2], -0.97 * room.inside, 0.97 * room.inside)
        centre[2] = max(centre[2], 0.15)
        aim = room.target + rng.normal(0, 0.08, 3) * radius - centre
        poses.append((centre, aim / np.linalg.norm(aim)))
    return poses


def _walk(room: Room, count: int, rng: np.random.Generator) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return centres along a short walk, the view swinging about a direction."""
    start = np.array([*rng.uniform(-0.7, 0.7, 2) * room.inside, rng.uniform(1.0, 1.8)])
    step = np.array([*rng.normal(0, 0.2, 2), rng.normal(0, 0.03)])
    heading, swing = rng.uniform(0, 2 * np.pi), rng.normal(0, 0.25)
    pitch = rng.normal(np.radians(8), np.radians(10))
    poses = []
    for k in range(count):
        yaw = heading + swing * k + rng.normal(0, 0.05)
        down = float(np.clip(pitch + rng.normal(0, 0.08), -1.3, 1.4))
        forward = np.array([np.cos(yaw) * np.cos(down), np.sin(yaw) * np.cos(down), -np.sin(down)])
        centre = start + step * k + rng.normal(0, 0.03, 3)
        centre[:2] = np.clip(centre[:2], -0.95 * room.inside, 0.95 * room.inside)
        poses.append((centre, forward))
    return poses
