"""Photos of a textured box-shaped room with a known camera path, ray-cast with numpy."""

from __future__ import annotations

import cv2
import numpy as np

from garden_models.geometry.camera import pixel_grid, pixel_rays
from garden_models.geometry.rigid import invert_rigid
from garden_models.scene import Capture, KnownCamera, Photo

SIZE = (400, 300)
FOCAL = 330.0
K = np.array([[FOCAL, 0, SIZE[0] / 2], [0, FOCAL, SIZE[1] / 2], [0, 0, 1]])
WALLS = ((0, 2.0), (1, 1.2), (2, 3.0), (0, -2.0))
"""Planes of the room: (axis, coordinate) in a world with x right, y down, z ahead."""


def noise_texture(seed: int, size: int = 1024) -> np.ndarray:
    """Return a picture with structure at all scales."""
    rng = np.random.default_rng(seed)
    total = np.zeros((size, size, 3), np.float32)
    for cells, weight in ((8, 0.5), (32, 0.7), (128, 1.0), (400, 1.0)):
        coarse = rng.random((cells, cells, 3), np.float32)
        total += weight * cv2.resize(coarse, (size, size), interpolation=cv2.INTER_CUBIC)
    total -= total.min()
    return (255 * total / total.max()).astype(np.uint8)


def look_at(centre: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Return ``camera_from_world`` of a level camera."""
    z = (target - centre) / np.linalg.norm(target - centre)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    rotation = np.stack([x, np.cross(z, x), z])
    return np.hstack([rotation, (-rotation @ centre)[:, None]])


def path(count: int) -> list[np.ndarray]:
    """Return cameras on an arc that look at the far wall's foot."""
    angles = np.linspace(-0.5, 0.5, count)
    return [
        look_at(
            np.array([1.6 * np.sin(a), -0.2 + 0.3 * np.cos(3 * a), 1.8 - 1.6 * np.cos(a)]),
            np.array([0.3 * np.sin(2 * a), 0.6, 2.6]),
        )
        for a in angles
    ]


def render(camera_from_world: np.ndarray, textures: list[np.ndarray]) -> np.ndarray:
    """Return the photo (4 rays a pixel) that a camera in the room takes."""
    fine = (2 * SIZE[0], 2 * SIZE[1])
    rays = pixel_rays(pixel_grid(fine[1], fine[0]) / 2, K)
    world_from_camera = invert_rigid(camera_from_world)
    directions = rays @ world_from_camera[:3, :3].T
    centre = world_from_camera[:3, 3]
    nearest = np.full(rays.shape[:2], np.inf)
    picture = np.zeros((*rays.shape[:2], 3), np.uint8)
    for (axis, coordinate), texture in zip(WALLS, textures, strict=True):
        with np.errstate(divide="ignore"):
            distance = (coordinate - centre[axis]) / directions[..., axis]
        distance[distance <= 0] = np.inf
        hit = distance < nearest
        points = centre + np.where(hit, distance, 0)[..., None] * directions
        u, v = (points[..., other] for other in range(3) if other != axis)
        scale = texture.shape[0] / 8
        colour = cv2.remap(
            texture,
            ((u + 4) * scale).astype(np.float32),
            ((v + 4) * scale).astype(np.float32),
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REFLECT,
        )
        picture[hit] = colour[hit]
        nearest = np.minimum(nearest, distance)
    return cv2.resize(picture, SIZE, interpolation=cv2.INTER_AREA)


def room_capture(count: int, seed: int = 0) -> Capture:
    """Return photos of the room with their true cameras."""
    textures = [noise_texture(seed * 10 + i) for i in range(len(WALLS))]
    photos, cameras = [], []
    for i, pose in enumerate(path(count)):
        photos.append(Photo(f"{i:02d}.png", render(pose, textures), SIZE))
        cameras.append(KnownCamera(f"{i:02d}.png", K, pose))
    return Capture(tuple(photos), tuple(cameras))
