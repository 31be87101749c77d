"""Ask a model for the geometry of a capture's photos."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from garden_models.progress import Progress, silent
from garden_models.reconstruction.chunk_limits import ChunkLimits
from garden_models.reconstruction.gaussian_check import judge_gaussians
from garden_models.reconstruction.geometry_model import (
    GeometryPrediction,
    GeometryRequest,
    PredictGeometry,
)
from garden_models.reconstruction.long_capture import predict_long
from garden_models.reconstruction.memory_need import MemoryNeed
from garden_models.reconstruction.photo_geometry_config import PhotoGeometry
from garden_models.reconstruction.undistort import undistort
from garden_models.scene import BadInput, Capture, KnownCamera, Photo


def predict_geometry(
    capture: Capture,
    predict: PredictGeometry,
    need: Callable[[GeometryRequest], MemoryNeed],
    config: PhotoGeometry,
    progress: Progress = silent,
) -> GeometryPrediction:
    """Return what a model predicts of the photos, in the order of ``used_photos``.

    Known cameras are given to the model; the answer is then in their world. Raises BadInput if
    fewer than two photos can be used or they do not fit the stated memory.
    """
    request = replace(
        request_of(capture), want_gaussians=config.gaussians, want_tokens=config.camera_tokens
    )
    if len(request.photos) < 2:
        raise BadInput("geometry needs two photos or more (with cameras, if cameras are given)")
    limits = ChunkLimits(config.gpu_memory_gb, config.overlap)
    found = predict_long(request, predict, need(request), limits, progress)
    return replace(found, verdict=found.verdict.worst(judge_gaussians(found)))


def used_photos(capture: Capture) -> tuple[tuple[Photo, KnownCamera | None], ...]:
    """Return the photos that are predicted: those with cameras if any are given, else all."""
    if not capture.cameras:
        return tuple((photo, None) for photo in capture.photos)
    known = {camera.photo: camera for camera in capture.cameras}
    return tuple((p, known[p.name]) for p in capture.photos if p.name in known)


def request_of(capture: Capture) -> GeometryRequest:
    """Return the request for a capture's photos; lens distortion of known cameras is removed."""
    used = used_photos(capture)
    photos, K, cameras = [], [], []
    for photo, camera in used:
        if camera is None:
            photos.append(photo.rgb)
            continue
        size = photo.rgb.shape[1], photo.rgb.shape[0]
        photos.append(undistort(photo.rgb, camera.K, camera.distortion, size))
        K.append(np.asarray(camera.K, np.float64))
        cameras.append(np.asarray(camera.camera_from_world[:3], np.float64))
    if not K:
        return GeometryRequest(tuple(photos))
    return GeometryRequest(tuple(photos), np.stack(K), np.stack(cameras))
