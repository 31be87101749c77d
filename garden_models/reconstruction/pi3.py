"""Pi3 and Pi3X: photos to cameras and points, in no photo's frame in particular.

Its camera poses are ``world_from_camera``, OpenCV; its confidence is a logit; it predicts each
photo's points in the camera's frame and no intrinsics, which are fitted to them. Pi3X tells
metres, about, and can be given cameras; Pi3's unit is its own.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from PIL import Image

from garden_models.foundation.model_card import ModelCard, Terms, WeightFile
from garden_models.geometry.rigid import homogeneous, invert_rigid
from garden_models.reconstruction.geometry_model import (
    GeometryPrediction,
    GeometryRequest,
    GeometryView,
    PredictGeometry,
)
from garden_models.reconstruction.given_cameras import in_given_world
from garden_models.reconstruction.intrinsics_from_points import intrinsics_from_points
from garden_models.reconstruction.load_network_class import load_network_class, weight_names
from garden_models.reconstruction.memory_need import RUNTIME_GB, MemoryNeed, weights_gb
from garden_models.reconstruction.model_contract import check_finite, check_request, proper_camera
from garden_models.reconstruction.photo_framing import Framing, Photo, frame_photos
from garden_models.scene import BadGeometry

PIXELS, PATCH = 255_000, 14
METRIC_WEIGHT = "metric_token"
"""Pi3X has it, Pi3 does not."""
LEAST_CONFIDENCE = 0.1
"""Points below it are not to be used, by the model's own example."""

CARD = ModelCard(
    name="pi3",
    title="Pi3 and Pi3X",
    source="https://github.com/yyfz/Pi3",
    stage="reconstruct",
    terms=Terms("BSD-3-Clause", "CC BY-NC 4.0", commercial=False),
    weights=(WeightFile("model.safetensors", "yyfz233/Pi3X or yyfz233/Pi3"),),
    imports=("pi3", "safetensors"),
    install="git clone https://github.com/yyfz/Pi3 and put the clone on PYTHONPATH",
)


def load(weights: Path, device: str) -> PredictGeometry:
    """Return the model of a weight folder: Pi3X if its weights tell metres, else Pi3.

    Raises BadInput if the package or a file is missing, or the weights do not fit.
    """
    metric = METRIC_WEIGHT in weight_names(weights)
    module, name = ("pi3.models.pi3x", "Pi3X") if metric else ("pi3.models.pi3", "Pi3")
    net = load_network_class(module, name, weights, CARD, {}).to(device)
    return lambda request: predict(net, request, torch.device(device), metric)


def predict(
    net: Any, request: GeometryRequest, device: torch.device, metric: bool
) -> GeometryPrediction:
    """Return what the network predicts of photos; raise BadInput or BadGeometry."""
    check_request(request, CARD.name)
    pictures, framings = frame_photos(request.photos, resized)
    batch = torch.from_numpy(pictures.transpose(0, 3, 1, 2).astype(np.float32) / 255)[None]
    given = _given(request, framings, device) if metric else {}
    with torch.inference_mode():
        found = net(batch.to(device), **given)
    poses = check_finite(_numpy(found["camera_poses"]), "cameras")
    points, logits = _numpy(found["local_points"]), _numpy(found["conf"])[..., 0]
    views = tuple(
        read_view(poses[i], points[i], logits[i], framing) for i, framing in enumerate(framings)
    )
    if request.camera_from_world is None:
        return GeometryPrediction(views, metric)
    placed = in_given_world(views, request, framings, metric)
    return GeometryPrediction(placed.views, metric, verdict=placed.verdict)


def _given(
    request: GeometryRequest, framings: tuple[Framing, ...], device: torch.device
) -> dict[str, torch.Tensor]:
    if request.K is None or request.camera_from_world is None:
        return {}
    pairs = zip(framings, request.K, strict=True)
    K = np.stack([framing.model_intrinsics(k) for framing, k in pairs])
    poses = np.stack([invert_rigid(camera) for camera in request.camera_from_world])
    return {
        "intrinsics": torch.from_numpy(K.astype(np.float32))[None].to(device),
        "poses": torch.from_numpy(poses.astype(np.float32))[None].to(device),
    }


def target_size(size: tuple[int, int]) -> tuple[int, int]:
    """Return (width, height), multiples of 14, of about 255,000 pixels and the same shape."""
    factor = (PIXELS / (size[0] * size[1])) ** 0.5
    wide, high = size[0] * factor, size[1] * factor
    columns, rows = round(wide / PATCH), round(high / PATCH)
    while columns * rows * PATCH * PATCH > PIXELS:
        if columns / rows > wide / high:
            columns -= 1
        else:
            rows -= 1
    return max(1, columns) * PATCH, max(1, rows) * PATCH


def memory_need(weights: Path, request: GeometryRequest) -> MemoryNeed:
    """Return what the network needs for photos like those of the request.

    From its users' reports, not measured here: Pi3X takes about 200 photos in 80 GB, 80 with
    cameras given (its issue 109); Pi3 about three times as many as Pi3X (issue 131).
    """
    per_photo = 0.13
    if METRIC_WEIGHT in weight_names(weights):
        per_photo = 0.4 if request.K is None else 1.0
    return MemoryNeed(RUNTIME_GB + weights_gb(weights), per_photo)


def resized(photo: Photo) -> Photo:
    """Return a photo at the size that the model reads."""
    size = target_size((photo.shape[1], photo.shape[0]))
    return np.asarray(Image.fromarray(photo).resize(size, Image.Resampling.LANCZOS), np.uint8)


def read_view(
    world_from_camera: Float[np.ndarray, "4 4"],
    points_camera: Float[np.ndarray, "h w 3"],
    logits: Float[np.ndarray, "h w"],
    framing: Framing,
) -> GeometryView:
    """Return one photo's part of the answer."""
    confidence = 1 / (1 + np.exp(-np.clip(logits, -50, 50)))
    depth = points_camera[..., 2]
    valid = np.isfinite(points_camera).all(-1) & (depth > 0) & (confidence > LEAST_CONFIDENCE)
    try:
        K = intrinsics_from_points(points_camera, confidence * valid)
    except ValueError as error:
        raise BadGeometry(
            f"the model is sure of nothing in a photo ({error}): leave out photos that show no "
            "surroundings"
        ) from error
    camera = invert_rigid(homogeneous(proper_camera(world_from_camera)))
    return GeometryView(
        depth=framing.whole(np.where(valid, depth, 0).astype(np.float32)),
        confidence=framing.whole(np.where(valid, confidence, 0).astype(np.float32)),
        seen=framing.seen(),
        K=framing.whole_intrinsics(K),
        camera_from_world=camera[:3],
    )


def _numpy(tensor: torch.Tensor) -> np.ndarray:
    array: np.ndarray = tensor[0].float().cpu().numpy()
    return array
