"""Photograph a procedural room: pictures, depth and fused points, as a reconstruction.

For tests and benchmarks: everything that reads a reconstruction can be asked about these.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, UInt8

from garden_models.geometry.camera import pixel_grid, pixel_rays
from garden_models.geometry.depth_normals import depth_normals
from garden_models.geometry.rigid import invert_rigid, transform_points
from garden_models.gravity.training.scenes.observe import Photographed
from garden_models.gravity.training.scenes.sensing import (
    Look,
    blank_faces,
    look,
    measured_depth,
)
from garden_models.gravity.training.scenes.surfaces import FACES
from garden_models.scene import PointCloud, Reconstruction, Scale, View

PHOTO_SIZE = (320, 240)
POINTS_GRID = 96
GREY_NOISE = 2.5


def photograph(shot: Photographed, rng: np.random.Generator) -> Reconstruction:
    """Return a reconstruction with the shot's errors; its K must be for ``PHOTO_SIZE``."""
    surfaces = shot.room.surfaces
    blank = blank_faces(surfaces, shot.errors, rng)
    paint = _Paint(len(surfaces) * FACES, blank, rng)
    views, xyz, normals = [], [], []
    for k, (true, camera) in enumerate(
        zip(shot.camera_from_room, shot.camera_from_world, strict=True)
    ):
        seen = look(surfaces, shot.K, true, PHOTO_SIZE)
        depth = measured_depth(seen, blank, shot.errors, rng)
        rgb = paint.picture(seen, shot.K, true)
        confidence = (depth > 0).astype(np.float32)
        views.append(View(f"{k:03d}.jpg", rgb, depth, confidence, shot.K, camera[:3], PHOTO_SIZE))
        places, facing = depth_normals(depth, shot.K, camera, POINTS_GRID)
        xyz.append(places)
        normals.append(facing)
    cloud = _cloud(np.concatenate(xyz), np.concatenate(normals))
    return Reconstruction(
        tuple(views), cloud, cloud.xyz[::20], (), Scale("unknown"), cameras_source="estimated"
    )


def _cloud(xyz: np.ndarray, normal: np.ndarray) -> PointCloud:
    grey = np.full((len(xyz), 3), 128, np.uint8)
    return PointCloud(xyz, grey, normal, np.full(len(xyz), 0.02), np.ones(len(xyz)))


class _Paint:
    """A grey and a pattern for every face, the same in every photo."""

    def __init__(self, faces: int, blank: np.ndarray, rng: np.random.Generator) -> None:
        self.grey = rng.uniform(50, 220, faces)
        self.contrast = np.where(blank, 0.0, rng.uniform(0, 45, faces))
        self.axes = rng.normal(size=(faces, 3)) * rng.uniform(2, 12, (faces, 1))
        straight = rng.uniform(size=faces) < 0.5
        self.axes[straight] *= np.eye(3)[rng.integers(3, size=straight.sum())] * 2
        self.rng = rng

    def picture(
        self, seen: Look, K: Float[np.ndarray, "3 3"], camera_from_room: Float[np.ndarray, "4 4"]
    ) -> UInt8[np.ndarray, "h w 3"]:
        """Return the photo of a look: greys, stripes across each face, noise."""
        height, width = seen.depth.shape
        rays = pixel_rays(pixel_grid(height, width), K) * seen.depth[..., None]
        room = transform_points(invert_rigid(camera_from_room), rays.reshape(-1, 3))
        face = np.maximum(seen.face.reshape(-1), 0)
        stripes = np.sin(np.einsum("ni,ni->n", room, self.axes[face])) > 0
        grey = self.grey[face] + self.contrast[face] * stripes
        grey = np.where(seen.face.reshape(-1) < 0, 20.0, grey)
        grey = grey + self.rng.normal(0, GREY_NOISE, grey.shape)
        flat = np.clip(grey, 0, 255).astype(np.uint8).reshape(height, width)
        return np.repeat(flat[..., None], 3, axis=2)
