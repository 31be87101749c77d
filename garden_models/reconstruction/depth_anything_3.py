"""Depth-Anything-3: photos to cameras, depth, camera tokens and Gaussians.

All sizes, by ``config.json``'s ``model_name``. Its cameras are ``camera_from_world``, OpenCV;
principal points lie in the middle of the picture, so pixel centres are at +0.5; depth is
z-depth in a unit of its own, metres for nested ones.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool, Float

from garden_models.foundation.model_card import ModelCard, Terms, WeightFile
from garden_models.reconstruction.da3_gaussians import moved_by_view, read_gaussians
from garden_models.reconstruction.da3_memory import memory_need
from garden_models.reconstruction.da3_network import (
    GAUSSIAN_IMPORTS,
    STRATEGY,
    Da3Network,
    Watched,
    load_network,
    watching,
)
from garden_models.reconstruction.da3_photos import prepare
from garden_models.reconstruction.geometry_model import (
    CameraTokens,
    Gaussians,
    GeometryPrediction,
    GeometryRequest,
    GeometryView,
    PredictGeometry,
    joined_gaussians,
)
from garden_models.reconstruction.given_cameras import InGivenWorld, in_given_world
from garden_models.reconstruction.model_contract import check_finite, check_request, proper_camera
from garden_models.reconstruction.photo_framing import Framing
from garden_models.reconstruction.similarity import Similarity, from_camera
from garden_models.scene import OK, BadGeometry, BadInput

__all__ = ["CARD", "load", "memory_need"]

SKY = 0.3
"""What the sky head says from which on a pixel is sky."""
METRIC_FOCAL = 300.0
"""Focal length in pixels at which the metric network's answer is in metres."""
LEAST_DISTANCE = 0.1
RELATIVE = ("da3mono-large",)
"""Networks whose depth is right up to a change of scale in each photo."""

FREE = Terms("Apache-2.0", "Apache-2.0", commercial=True)
CARD = ModelCard(
    name="depth_anything_3",
    title="Depth-Anything-3 (small to giant, metric, nested)",
    source="https://github.com/ByteDance-Seed/Depth-Anything-3",
    stage="reconstruct",
    terms=Terms("Apache-2.0", "CC BY-NC 4.0", commercial=False),
    weights=(
        WeightFile("config.json", "of depth-anything/DA3NESTED-GIANT-LARGE-1.1 or another size"),
        WeightFile("model.safetensors"),
    ),
    imports=("depth_anything_3", "omegaconf", "addict", "einops", "safetensors"),
    install="pip install --no-deps depth-anything-3 && pip install omegaconf addict einops "
    "(Gaussians also need evo and e3nn)",
    variant_key="model_name",
    variants=dict.fromkeys(("da3-small", "da3-base", "da3metric-large"), FREE),
)


def load(weights: Path, device: str) -> PredictGeometry:
    """Return the model of a weight folder.

    Raises BadInput if the package or a file is missing, if the weights do not fit, or for a
    network that predicts neither cameras nor metres.
    """
    network = load_network(weights, device)
    if network.kind in RELATIVE:
        raise BadInput(
            f"{network.kind} predicts depth whose scale differs from photo to photo: use a "
            "model that predicts cameras (da3-small to da3nested-giant-large)"
        )
    return lambda request: predict(network, request)


def predict(network: Da3Network, request: GeometryRequest) -> GeometryPrediction:
    """Return what a network predicts of photos.

    Raises BadInput for a request that this network cannot answer, BadGeometry if its answer
    is not usable.
    """
    _check(network, request)
    pictures, framings = prepare(request.photos)
    K = camera_from_world = None
    if request.camera_from_world is not None and request.K is not None and network.poses:
        pairs = zip(framings, request.K, strict=True)
        K = _tensor(np.stack([framing.model_intrinsics(k) for framing, k in pairs]), network)
        camera_from_world = _tensor(conditioning(request.camera_from_world), network)
    with watching(network) as watched:
        try:
            found = network.net(
                _tensor(pictures, network),
                camera_from_world,
                K,
                export_feat_layers=[],
                infer_gs=request.want_gaussians,
                use_ray_pose=False,
                ref_view_strategy=STRATEGY,
            )
        except AssertionError as error:
            raise BadGeometry(
                f"{network.kind} found no scale for these photos ({error}): leave out photos "
                "that show nothing but sky"
            ) from error
    if not network.poses:
        return metric_prediction(found, request, framings)
    return prediction(network, found, watched, request, framings)


def _check(network: Da3Network, request: GeometryRequest) -> None:
    check_request(request, network.kind, extras=True)
    if not network.poses and request.K is None:
        raise BadInput(
            f"{network.kind} predicts depth, but no cameras: give known cameras, or use a nested "
            "model (da3nested-giant-large)"
        )
    if request.want_gaussians and not network.gaussians:
        raise BadInput(
            f"{network.kind} here predicts no Gaussians: they need da3-giant or "
            f"da3nested-giant-large, and the packages {' and '.join(GAUSSIAN_IMPORTS)}; or ask for "
            "none (geometry.gaussians = false)"
        )
    if request.want_tokens and not network.poses:
        raise BadInput(
            f"{network.kind} has no camera tokens: ask for none (geometry.camera_tokens = false)"
        )


def _tensor(array: np.ndarray, network: Da3Network) -> torch.Tensor:
    return torch.from_numpy(np.ascontiguousarray(array, np.float32))[None].to(network.device)


def conditioning(
    camera_from_world: Float[np.ndarray, "n 3 4"],
) -> Float[np.ndarray, "n 4 4"]:
    """Return given cameras as the network was trained on them: the first is the world, and
    the median distance from it (the lower of two, itself among them) is one.
    """
    poses = np.tile(np.eye(4), (len(camera_from_world), 1, 1))
    poses[:, :3] = camera_from_world[:, :3]
    poses = poses @ np.linalg.inv(poses[0])
    distance = np.sort(np.linalg.norm(poses[:, :3, 3], axis=1))
    poses[:, :3, 3] /= max(float(distance[(len(distance) - 1) // 2]), LEAST_DISTANCE)
    return poses


def confidence_share(confidence: Float[np.ndarray, "*s"]) -> Float[np.ndarray, "*s"]:
    """Return the model's confidence (1 and up) as a share: 0 where it knows nothing, 1/2 at 2."""
    return (1 - 1 / np.maximum(confidence, 1)).astype(np.float32)


def prediction(
    network: Da3Network,
    found: Any,
    watched: Watched,
    request: GeometryRequest,
    framings: tuple[Framing, ...],
) -> GeometryPrediction:
    """Return the answer of a network that predicts cameras, in our conventions."""
    cameras = check_finite(_numpy(found["extrinsics"]), "cameras")
    intrinsics = check_finite(_numpy(found["intrinsics"]), "intrinsics")
    confidence = confidence_share(_numpy(found["depth_conf"]))
    depth = _numpy(found["depth"]) * (confidence > 0)
    views = tuple(
        _view(depth[i], confidence[i], framing, intrinsics[i], cameras[i])
        for i, framing in enumerate(framings)
    )
    metric, verdict, moves = network.nested, OK, None
    if request.camera_from_world is not None:
        predicted = [view.camera_from_world for view in views]
        given = in_given_world(views, request, framings, metric)
        views, verdict = given.views, given.verdict
        moves = _moves(predicted, given)
    tokens: tuple[CameraTokens, ...] = ()
    if request.want_tokens:
        tokens = (_tokens(network, watched, request),)
    gaussians = None
    if request.want_gaussians:
        gaussians = _gaussians(found, confidence > 0, moves)
    return GeometryPrediction(views, metric, tokens, gaussians, verdict)


def _moves(predicted: list[np.ndarray], given: InGivenWorld) -> list[Similarity]:
    return [
        from_camera(camera, view.camera_from_world, given.factor)
        for camera, view in zip(predicted, given.views, strict=True)
    ]


def _gaussians(
    found: Any, keep: Bool[np.ndarray, "n h w"], moves: list[Similarity] | None
) -> Gaussians:
    parts = read_gaussians(found["gaussians"], float(found.get("scale_factor", 1.0)), keep)
    return joined_gaussians(parts if moves is None else moved_by_view(parts, moves))


def _tokens(network: Da3Network, watched: Watched, request: GeometryRequest) -> CameraTokens:
    views = len(request.photos)
    tokens = check_finite(watched.tokens[0].float().cpu().numpy(), "camera tokens")
    reference = watched.reference(views, request.camera_from_world is not None)
    return CameraTokens(network.kind, np.arange(views), tokens, reference)


def metric_prediction(
    found: Any, request: GeometryRequest, framings: tuple[Framing, ...]
) -> GeometryPrediction:
    """Return the answer of the network that predicts metres but no cameras, with those given."""
    assert request.K is not None and request.camera_from_world is not None
    sky = _numpy(found["sky"]) >= SKY
    depth = _numpy(found["depth"])
    views = []
    for i, framing in enumerate(framings):
        K = framing.model_intrinsics(request.K[i])
        metres = depth[i] * np.float32((K[0, 0] + K[1, 1]) / 2 / METRIC_FOCAL) * ~sky[i]
        sure = (~sky[i]).astype(np.float32)
        views.append(_view(metres, sure, framing, K, request.camera_from_world[i]))
    return GeometryPrediction(tuple(views), metric=True)


def _view(
    depth: Float[np.ndarray, "h w"],
    confidence: Float[np.ndarray, "h w"],
    framing: Framing,
    K: Float[np.ndarray, "3 3"],
    camera_from_world: Float[np.ndarray, "3 4"],
) -> GeometryView:
    valid = np.isfinite(depth) & (depth > 0)
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
