"""Turn COLMAP's model into a ``SparseModel`` in metres under a stated scale."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pycolmap
from jaxtyping import Float, Int, UInt8

from garden_models.geometry.camera import project
from garden_models.geometry.rigid import transform_points
from garden_models.scene import Camera, Photo, Scale, SparseModel

ASSUMED_MEDIAN_DEPTH_M = 1.5
"""Median distance from cameras to sparse points that is assumed where nothing tells the
scale: someone who walks around things in a room."""


def opencv_distortion(camera: pycolmap.Camera) -> Float[np.ndarray, "4"]:
    """Return k1, k2, p1, p2 of a COLMAP camera."""
    names = [name.strip() for name in camera.params_info.split(",")]
    values = dict(zip(names, camera.params, strict=True))
    radial = values.get("k1", values.get("k", 0.0))
    return np.array([radial, values.get("k2", 0.0), values.get("p1", 0.0), values.get("p2", 0.0)])


def registered_images(model: pycolmap.Reconstruction) -> list[pycolmap.Image]:
    """Return the images with a pose, in the order of their ids."""
    return [model.images[i] for i in sorted(model.images) if model.images[i].has_pose]


def cameras_of(model: pycolmap.Reconstruction) -> tuple[Camera, ...]:
    """Return the model's cameras, in the order of the photos."""
    return tuple(
        Camera(
            photo=image.name,
            size=(image.camera.width, image.camera.height),
            K=image.camera.calibration_matrix(),
            camera_from_world=image.cam_from_world().matrix(),
            distortion=opencv_distortion(image.camera),
        )
        for image in registered_images(model)
    )


def tracks_of(
    model: pycolmap.Reconstruction,
) -> tuple[Float[np.ndarray, "n 3"], Int[np.ndarray, " n_plus_1"], Int[np.ndarray, " m"]]:
    """Return the points, and the cameras that see each (flattened, sorted)."""
    index = {image.image_id: i for i, image in enumerate(registered_images(model))}
    points, views = [], []
    for key in sorted(model.points3D):
        point = model.points3D[key]
        seen = sorted({index[e.image_id] for e in point.track.elements if e.image_id in index})
        points.append(point.xyz)
        views.append(seen)
    start = np.concatenate([[0], np.cumsum([len(v) for v in views], dtype=np.int64)])
    flat = np.array([i for v in views for i in v], np.int64)
    return np.array(points).reshape(-1, 3), start.astype(np.int64), flat


def colours(
    points_world: Float[np.ndarray, "n 3"],
    track_start: Int[np.ndarray, " n_plus_1"],
    track_views: Int[np.ndarray, " m"],
    cameras: Sequence[Camera],
    photos: Sequence[Photo],
) -> UInt8[np.ndarray, "n 3"]:
    """Return each point's mean colour in the photos that see it."""
    rgb = {photo.name: photo.rgb for photo in photos}
    owner = np.repeat(np.arange(len(points_world)), np.diff(track_start))
    total = np.zeros((len(points_world), 3))
    for index, camera in enumerate(cameras):
        seen = owner[track_views == index]
        pixels, _ = project(points_world[seen], camera.K, camera.camera_from_world)
        width, height = camera.size
        columns = np.clip(np.nan_to_num(pixels[:, 0]), 0, width - 1).astype(np.int64)
        rows = np.clip(np.nan_to_num(pixels[:, 1]), 0, height - 1).astype(np.int64)
        np.add.at(total, seen, rgb[camera.photo][rows, columns])
    return np.rint(total / np.maximum(np.diff(track_start), 1)[:, None]).astype(np.uint8)


def observed_depths(
    points_world: Float[np.ndarray, "n 3"],
    track_start: Int[np.ndarray, " n_plus_1"],
    track_views: Int[np.ndarray, " m"],
    cameras: Sequence[Camera],
) -> Float[np.ndarray, " m"]:
    """Return the z-depth of every observation."""
    owner = np.repeat(np.arange(len(points_world)), np.diff(track_start))
    depths = np.empty(len(owner))
    for index, camera in enumerate(cameras):
        seen = track_views == index
        depths[seen] = transform_points(camera.camera_from_world, points_world[owner[seen]])[:, 2]
    return depths


def assumed_scale(depths: Float[np.ndarray, " m"]) -> Scale:
    """Return the scale that puts the median observed depth at the assumed distance."""
    if len(depths) == 0:
        return Scale("unknown", 1.0, "nothing was measured")
    factor = ASSUMED_MEDIAN_DEPTH_M / float(np.median(depths))
    note = (
        "photos alone do not tell the size of things; assumed that the median distance from "
        f"the cameras to what they see is {ASSUMED_MEDIAN_DEPTH_M} m"
    )
    return Scale("unknown", factor, note)


def sparse_model(
    model: pycolmap.Reconstruction, photos: Sequence[Photo], scale: Scale | None = None
) -> SparseModel:
    """Return COLMAP's model of ``photos`` in metres; without ``scale`` one is assumed."""
    cameras = cameras_of(model)
    points, start, views = tracks_of(model)
    scale = scale or assumed_scale(observed_depths(points, start, views, cameras))
    registered = {camera.photo for camera in cameras}
    return SparseModel(
        cameras=tuple(_scaled(camera, scale.metres_per_unit) for camera in cameras),
        unregistered=tuple(p.name for p in photos if p.name not in registered),
        points_world=points * scale.metres_per_unit,
        points_rgb=colours(points, start, views, cameras, photos),
        track_start=start,
        track_views=views,
        scale=scale,
    )


def _scaled(camera: Camera, factor: float) -> Camera:
    pose = camera.camera_from_world.copy()
    pose[:, 3] *= factor
    return replace(camera, camera_from_world=pose)
