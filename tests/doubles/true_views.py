"""A scene whose truth is known, for doubles that answer with it in a model's own convention.

The doubles recognise photos by what they show, so that order, chunks and cuts are the
caller's choice.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from garden_models.reconstruction.geometry_model import GeometryRequest
from garden_models.reconstruction.similarity import Similarity
from tests.doubles.truth_scene import TruthScene
from tests.garden_models.reconstruction.textured_room import look_at

THUMB = (12, 12)


@dataclass(frozen=True)
class TrueViews:
    """Photos with exact z-depth (same size), intrinsics and ``camera_from_world``."""

    photos: tuple[np.ndarray, ...]
    depth: tuple[np.ndarray, ...]
    K: np.ndarray
    camera_from_world: np.ndarray

    def __len__(self) -> int:
        return len(self.photos)

    def request(self, **options: object) -> GeometryRequest:
        """Ask about all photos."""
        return GeometryRequest(self.photos, **options)  # type: ignore[arg-type]

    def with_cameras(self, **options: object) -> GeometryRequest:
        """Ask about all photos, with their true cameras."""
        return self.request(K=self.K, camera_from_world=self.camera_from_world, **options)

    def moved(self, move: Similarity) -> TrueViews:
        """The same photos in another world."""
        return replace(
            self,
            depth=tuple(d * move.scale for d in self.depth),
            camera_from_world=np.stack([move.camera(c) for c in self.camera_from_world]),
        )

    def recognised(self, pictures: np.ndarray, cut: bool = False) -> list[int]:
        """Which photos these pictures (n, h, w, 3) in 0..255 are of.

        ``cut``: pictures may lack the photos' top and bottom or sides.
        """
        found = []
        for picture in pictures:
            errors = []
            for photo in self.photos:
                same = _cut_to(photo, picture.shape[1] / picture.shape[0]) if cut else photo
                errors.append(float(np.abs(_thumb(same) - _thumb(picture)).mean()))
            assert min(errors) < 12, f"a picture is of none of the photos (off by {min(errors)})"
            found.append(int(np.argmin(errors)))
        return found

    def depth_at(self, index: int, K_model: np.ndarray, size: tuple[int, int]) -> np.ndarray:
        """True depth of a photo at the pixels of a model's picture of it (width, height)."""
        width, height = size
        x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        K = self.K[index]
        column = (x - K_model[0, 2]) / K_model[0, 0] * K[0, 0] + K[0, 2]
        row = (y - K_model[1, 2]) / K_model[1, 1] * K[1, 1] + K[1, 2]
        depth = self.depth[index]
        return depth[
            np.clip(row.astype(int), 0, depth.shape[0] - 1),
            np.clip(column.astype(int), 0, depth.shape[1] - 1),
        ].astype(np.float32)

    def model_intrinsics(
        self, index: int, whole: tuple[int, int], cut: tuple[int, int]
    ) -> np.ndarray:
        """Intrinsics after a resize to ``whole`` and a cut about the middle to ``cut``."""
        height, width = self.photos[index].shape[:2]
        K = np.diag([whole[0] / width, whole[1] / height, 1.0]) @ self.K[index]
        K[0, 2] -= (whole[0] - cut[0]) // 2
        K[1, 2] -= (whole[1] - cut[1]) // 2
        return K


def _thumb(picture: np.ndarray) -> np.ndarray:
    return cv2.resize(picture.astype(np.float32), THUMB, interpolation=cv2.INTER_AREA)


def _cut_to(photo: np.ndarray, aspect: float) -> np.ndarray:
    height, width = photo.shape[:2]
    if width / height > aspect:
        keep = round(height * aspect)
        left = (width - keep) // 2
        return photo[:, left : left + keep]
    keep = round(width / aspect)
    top = (height - keep) // 2
    return photo[top : top + keep]


def box_room(count: int, size: tuple[int, int] = (112, 84), focal: float = 90.0) -> TrueViews:
    """Photos of the inside of a box of 6 x 3 x 5 m with a ball, from a walk around the middle.

    Depth and colours are exact at every pixel's centre.
    """
    width, height = size
    K = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1.0]])
    photos, depths, cameras = [], [], []
    for k in range(count):
        angle = 2 * np.pi * k / max(count, 24)
        centre = np.array([1.2 * np.cos(angle), -0.2 * np.sin(2 * angle), 1.2 * np.sin(angle)])
        aim = np.array([-0.6 * np.sin(angle), 0.6, 0.4 * np.cos(angle)])
        camera = look_at(centre, aim - 0.3 * centre)
        photo, depth = _photo(K, camera, size)
        photos.append(photo)
        depths.append(depth)
        cameras.append(camera)
    return TrueViews(tuple(photos), tuple(depths), np.tile(K, (count, 1, 1)), np.stack(cameras))


def _photo(
    K: np.ndarray, camera_from_world: np.ndarray, size: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray]:
    width, height = size
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    rays = np.stack([(x - K[0, 2]) / K[0, 0], (y - K[1, 2]) / K[1, 1], np.ones_like(x)], -1)
    R, t = camera_from_world[:, :3], camera_from_world[:, 3]
    origin, directions = -R.T @ t, rays @ R
    half = np.array([3.0, 1.5, 2.5])
    with np.errstate(divide="ignore"):
        walls = np.where(directions > 0, half - origin, -half - origin) / directions
    depth = np.min(np.where(np.isfinite(walls), walls, np.inf), axis=-1)
    ball = np.array([0.3, 0.7, 0.2])
    a = (directions**2).sum(-1)
    b = directions @ (origin - ball)
    c = ((origin - ball) ** 2).sum() - 0.5**2
    inside = b**2 - a * c
    hit = (-b - np.sqrt(np.maximum(inside, 0))) / a
    depth = np.where((inside > 0) & (hit > 0) & (hit < depth), hit, depth)
    points = origin + directions * depth[..., None]
    waves = np.stack(
        [np.sin(2.1 * points[..., i] + 1.3 * points[..., (i + 1) % 3] + i) for i in range(3)], -1
    )
    return (128 + 100 * waves).astype(np.uint8), depth.astype(np.float32)


def views_of_scene(scene: TruthScene) -> TrueViews:
    """The photos of a whole scene's truth, with what every pixel of them shows."""
    cameras = scene.cameras
    sizes = [(camera.rgb.shape[1], camera.rgb.shape[0]) for camera in cameras]
    pictures = [scene.picture(i, size) for i, size in enumerate(sizes)]
    return TrueViews(
        tuple(camera.rgb for camera in cameras),
        tuple(picture.depth.astype(np.float32) for picture in pictures),
        np.stack([camera.K for camera in cameras]),
        np.stack([camera.camera_from_world[:3] for camera in cameras]),
    )
