"""The sample capture as if reconstructed without error: exact cameras and depth."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from garden_models.geometry.camera import backproject_depth, camera_centre
from garden_models.geometry.gravity_view import gv_from_world
from garden_models.scene import GravityView, PointCloud, Reconstruction, Scale, Target, View
from tests.doubles.truth_scene import corner_scene
from tests.scenes.corner_truth import load_corner

SIZE = (384, 288)
CELL = 0.005
"""Points are fused in cubes of this side, metres."""


@lru_cache(maxsize=1)
def corner_reconstruction() -> tuple[Reconstruction, GravityView]:
    """Return all views at half the photos' size, and Gravity-View of the first."""
    corner, truth = load_corner(), corner_scene()
    views, parts = [], []
    for index, camera in enumerate(truth.cameras):
        depth = truth.picture(index, SIZE).depth
        K = camera.scaled_K(SIZE)
        view = View(
            photo=Path(corner.views[index].photo).name,
            rgb=cv2.resize(camera.rgb, SIZE, interpolation=cv2.INTER_AREA),
            depth=depth.astype(np.float32),
            confidence=(depth > 0).astype(np.float32),
            K=K,
            camera_from_world=camera.camera_from_world[:3],
            original_size=corner.views[index].size,
        )
        views.append(view)
        parts.append(_points(view))
    first = views[0]
    gravity = GravityView(
        gv_from_world(corner.down_world, first.camera_from_world),
        first.photo,
        corner.down_world,
        0.1,
        (),
    )
    cloud = _fused(parts)
    scale = Scale("known_cameras")
    return Reconstruction(tuple(views), cloud, cloud.xyz[:10], (), scale, "known"), gravity


def corner_target(name: str) -> Target:
    item = load_corner().object(name)
    return Target(name, item.target_photo, item.target_box)


def _points(view: View) -> tuple[np.ndarray, ...]:
    """Return points, colours and normals of every other pixel of every other row."""
    points = backproject_depth(view.depth.astype(float), view.K, view.camera_from_world)
    normal = np.cross(np.gradient(points, axis=0), np.gradient(points, axis=1))
    normal /= np.maximum(np.linalg.norm(normal, axis=2, keepdims=True), 1e-12)
    towards = camera_centre(view.camera_from_world) - points
    normal *= np.sign((normal * towards).sum(2, keepdims=True))
    keep = (slice(None, None, 2), slice(None, None, 2))
    valid = view.depth[keep] > 0
    return points[keep][valid], view.rgb[keep][valid], normal[keep][valid]


def _fused(parts: list[tuple[np.ndarray, ...]]) -> PointCloud:
    xyz, rgb, normal = (np.concatenate(part) for part in zip(*parts, strict=True))
    _, group = np.unique(np.floor(xyz / CELL).astype(int), axis=0, return_inverse=True)
    group = group.reshape(-1)
    count = np.bincount(group)

    def mean(values: np.ndarray) -> np.ndarray:
        return np.stack([np.bincount(group, values[:, i]) / count for i in range(3)], 1)

    direction = mean(normal)
    direction /= np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-12)
    return PointCloud(
        mean(xyz).astype(np.float32),
        mean(rgb.astype(float)).astype(np.uint8),
        direction.astype(np.float32),
        np.full(len(count), CELL, np.float32),
        np.minimum(count / 4.0, 1.0).astype(np.float32),
    )
