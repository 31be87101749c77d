"""VGGT: photos to cameras and depth.

Its pose encoding holds the translation and quaternion (xyzw) of ``camera_from_world``, OpenCV,
then the vertical and the horizontal field of view; the first photo is (about) the world; the
unit of length is its own. Principal points lie in the middle, so pixel centres are at +0.5.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from PIL import Image

from garden_models.foundation.model_card import ModelCard, Terms, WeightFile
from garden_models.geometry.rotation import matrix_from_quaternion
from garden_models.reconstruction.geometry_model import (
    GeometryPrediction,
    GeometryRequest,
    GeometryView,
    PredictGeometry,
)
from garden_models.reconstruction.given_cameras import in_given_world
from garden_models.reconstruction.load_network_class import load_network_class
from garden_models.reconstruction.memory_need import RUNTIME_GB, MemoryNeed, weights_gb
from garden_models.reconstruction.model_contract import check_finite, check_request, proper_camera
from garden_models.reconstruction.photo_framing import Framing, Photo, frame_photos

WIDTH, PATCH = 518, 14
TABLE_ROWS, PER_PHOTO_GB, DEPTH_HEAD_GB = 336, 0.195, 0.2
"""See ``memory_need``."""

CARD = ModelCard(
    name="vggt",
    title="VGGT",
    source="https://github.com/facebookresearch/vggt",
    stage="reconstruct",
    terms=Terms(
        "VGGT License",
        "CC BY-NC 4.0",
        commercial=False,
    ),
    weights=(WeightFile("model.safetensors", "of facebook/VGGT-1B"),),
    imports=("vggt", "safetensors"),
    install="git clone https://github.com/facebookresearch/vggt && pip install --no-deps ./vggt",
)


def load(weights: Path, device: str) -> PredictGeometry:
    """Return the model of a weight folder.

    Raises BadInput if the package or a file is missing, or the weights do not fit.
    """
    net = load_network_class(
        "vggt.models.vggt",
        "VGGT",
        weights,
        CARD,
        {"enable_point": False, "enable_track": False},
        leave_out=("point_head.", "track_head."),
    ).to(device)
    return lambda request: predict(net, request, torch.device(device))


def predict(net: Any, request: GeometryRequest, device: torch.device) -> GeometryPrediction:
    """Return what the network predicts of photos; raise BadInput or BadGeometry."""
    check_request(request, CARD.name)
    pictures, framings = frame_photos(request.photos, resized, longest=WIDTH)
    batch = torch.from_numpy(pictures.transpose(0, 3, 1, 2).astype(np.float32) / 255)
    with torch.inference_mode():
        found = net(batch.to(device))
    encoding = check_finite(_numpy(found["pose_enc"]), "cameras")
    depth = _numpy(found["depth"])[..., 0]
    confidence = confidence_share(_numpy(found["depth_conf"]))
    views = tuple(
        read_view(encoding[i], depth[i], confidence[i], framing)
        for i, framing in enumerate(framings)
    )
    if request.camera_from_world is None:
        return GeometryPrediction(views, metric=False)
    given = in_given_world(views, request, framings, metric=False)
    return GeometryPrediction(given.views, metric=False, verdict=given.verdict)


def target_size(size: tuple[int, int]) -> tuple[int, int]:
    """Return (width, height): 518 wide, the height a multiple of 14."""
    return WIDTH, max(PATCH, round(size[1] * WIDTH / size[0] / PATCH) * PATCH)


def resized(photo: Photo) -> Photo:
    """Return a photo at the size that the model reads, before it is cut to 518 high."""
    size = target_size((photo.shape[1], photo.shape[0]))
    return np.asarray(Image.fromarray(photo).resize(size, Image.Resampling.BICUBIC), np.uint8)


def memory_need(weights: Path, request: GeometryRequest) -> MemoryNeed:
    """Return what the network needs for photos like those of the request.

    Its own table for photos of 518 x 336 (1.69 GB and 0.195 GB a photo, up to 200) is
    proportional to the tokens, of which all 24 layers are kept; the depth head takes 0.2 GB
    for each of the 8 photos that it works on at once (its paper, section 4).
    """
    rows = [min(target_size((p.shape[1], p.shape[0]))[1], WIDTH) for p in request.photos]
    share = max(rows) / TABLE_ROWS
    fixed = RUNTIME_GB + weights_gb(weights)
    return MemoryNeed(fixed, PER_PHOTO_GB * share, DEPTH_HEAD_GB * share, 8)


def confidence_share(confidence: Float[np.ndarray, "*s"]) -> Float[np.ndarray, "*s"]:
    """Return the model's confidence (1 and up) as a share: 0 where it knows nothing, 1/2 at 2."""
    return (1 - 1 / np.maximum(confidence, 1)).astype(np.float32)


def camera_of(
    encoding: Float[np.ndarray, "9"], size: tuple[int, int]
) -> tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, "3 4"]]:
    """Return the intrinsics for ``size`` (width, height) and ``camera_from_world``."""
    width, height = size
    x, y, z, w = encoding[3:7].astype(np.float64)
    tan_y, tan_x = np.maximum(np.tan(encoding[7:9].astype(np.float64) / 2), 1e-6)
    K = np.array(
        [[width / 2 / tan_x, 0, width / 2], [0, height / 2 / tan_y, height / 2], [0, 0, 1.0]]
    )
    rotation = matrix_from_quaternion(np.array([w, x, y, z]))
    return K, np.column_stack([rotation, encoding[:3]])


def read_view(
    encoding: Float[np.ndarray, "9"],
    depth: Float[np.ndarray, "h w"],
    confidence: Float[np.ndarray, "h w"],
    framing: Framing,
) -> GeometryView:
    """Return one photo's part of the answer."""
    K, camera_from_world = camera_of(encoding, framing.seen_size)
    valid = np.isfinite(depth) & (depth > 0) & (confidence > 0)
    return GeometryView(
        depth=framing.whole(np.where(valid, depth, 0).astype(np.float32)),
        confidence=framing.whole(np.where(valid, confidence, 0).astype(np.float32)),
        seen=framing.seen(),
        K=framing.whole_intrinsics(K),
        camera_from_world=proper_camera(camera_from_world),
    )


def _numpy(tensor: torch.Tensor) -> np.ndarray:
    array: np.ndarray = tensor[0].float().cpu().numpy()
    return array
