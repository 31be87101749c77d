"""Count a network's operations and time it beside a plain form and what the machine can do."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from garden_models.disentanglement.network import model as network
from garden_models.disentanglement.network.describe import describe_context
from garden_models.disentanglement.network.model import PointClassifier
from garden_models.disentanglement.network.predict import (
    CHUNK,
    choose_context,
    context_tensors,
    predict,
)
from garden_models.disentanglement.training.crop import CropConfig, cut, is_target, turned
from garden_models.disentanglement.training.pair import Condition
from garden_models.disentanglement.training.scenes.furnish import furnish

POINTS = 200_000


@dataclass(frozen=True)
class Speed:
    """Seconds and operations of labelling one crop.

    ``processor_s`` is the processor time of all threads in ``seconds``: on a busy machine it
    says more. ``network_s`` is the network's share of ``seconds``; the rest describes points.
    ``plain_s`` is the same network with attention written out (a matrix of distances by head).
    ``machine_gflops`` is what large products of matrices reach with as many threads.
    """

    points: int
    threads: int
    seconds: float
    processor_s: float
    network_s: float
    plain_s: float
    giga_operations: float
    machine_gflops: float
    most_label_changes: float
    """Share of labels by which the plain form, in other chunks, differs."""

    @property
    def gflops(self) -> float:
        """Operations a second of the network, in billions."""
        return self.giga_operations / self.network_s


def measure(model: PointClassifier, points: int = POINTS, threads: int = 2) -> Speed:
    """Return the speed on a crop of a generated room."""
    before = torch.get_num_threads()
    torch.set_num_threads(threads)
    try:
        return _measure(model, *dense_crop(points), threads)
    finally:
        torch.set_num_threads(before)


def operations(model: PointClassifier, points: int) -> int:
    """Return the multiplications and additions of labelling so many points.

    Counted are products of matrices: linear layers and attention.
    """
    config = model.config
    tokens = config.scene_tokens + config.object_tokens
    by_point = _linear(model.embed_point) + _linear(model.head)
    points_blocks = [b for b in model.point_blocks if isinstance(b, network.NearBlock)]
    for block in points_blocks:
        by_point += sum(_linear(part) for part in (block.query, block.out, block.mlp))
        by_point += 2 * tokens * (2 * config.width + 8 * config.heads)
    by_token = sum(_linear(block) for block in model.token_blocks)
    by_token += len(model.token_blocks) * 2 * tokens * (2 * config.width + 8 * config.heads)
    keys = sum(_linear(block.key_value) for block in points_blocks)
    return points * by_point + tokens * (by_token + keys)


def plain_near_attention(
    query: Tensor, key: Tensor, value: Tensor, here: Tensor, there: Tensor, sharpness: Tensor
) -> Tensor:
    """Return the same as ``near_attention``, written as its formula."""
    distance = (here[:, :, None] - there[:, None]).square().sum(dim=-1)
    logits = query @ key.transpose(-1, -2) / query.shape[-1] ** 0.5
    logits = logits - sharpness[None, :, None, None] * distance[:, None]
    return logits.softmax(dim=-1) @ value


def dense_crop(points: int) -> tuple[np.ndarray, Condition]:
    """Return a crop of so many points of a generated room."""
    room = furnish("test", 0)
    config = CropConfig(pool=points + points // 5)
    triangles = turned(room, 0.3)
    for index in range(len(room.instances)):
        if is_target(room, index, config):
            drawn = cut(triangles, index, np.random.default_rng(0), config)
            if drawn is not None and len(drawn[0].points) >= points:
                return drawn[0].points[:points], drawn[1]
    raise ValueError(f"no crop of the room gives {points} points")


def _measure(
    model: PointClassifier, points: np.ndarray, condition: Condition, threads: int
) -> Speed:
    predict(model, points[:CHUNK], condition)  # the first call of a program is not its speed
    started, used = time.perf_counter(), time.process_time()
    labels = predict(model, points, condition) >= 0.5
    seconds, processor_s = time.perf_counter() - started, time.process_time() - used
    network_s = _network_seconds(model, points, condition)
    fast = network.near_attention
    try:
        network.near_attention = plain_near_attention
        plain_s = _network_seconds(model, points, condition)
        plain = predict(model, points, condition, chunk=3000) >= 0.5
    finally:
        network.near_attention = fast
    return Speed(
        len(points),
        threads,
        round(seconds, 3),
        round(processor_s, 3),
        round(network_s, 3),
        round(plain_s, 3),
        round(operations(model, len(points)) / 1e9, 2),
        round(_machine_gflops(), 1),
        float(np.mean(labels != plain)),
    )


def _network_seconds(model: PointClassifier, points: np.ndarray, condition: Condition) -> float:
    context = describe_context(points[choose_context(points)], condition, model.config)
    features = torch.from_numpy(np.resize(context.features, (CHUNK, context.features.shape[1])))
    started = time.perf_counter()
    with torch.inference_mode():
        tokens, places = model.tokens(*context_tensors(context, torch.device("cpu")))
        for start in range(0, len(points), CHUNK):
            model(features[None, : min(CHUNK, len(points) - start)], tokens, places)
    return time.perf_counter() - started


def _machine_gflops(side: int = 1536, rounds: int = 6) -> float:
    a = torch.rand(side, side)
    torch.mm(a, a)
    started = time.perf_counter()
    for _ in range(rounds):
        torch.mm(a, a)
    return 2 * side**3 * rounds / (time.perf_counter() - started) / 1e9


def _linear(module: nn.Module) -> int:
    return sum(
        2 * layer.in_features * layer.out_features
        for layer in module.modules()
        if isinstance(layer, nn.Linear)
    )
