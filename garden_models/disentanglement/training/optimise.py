"""Train the point classifier: binary cross-entropy on the points of a batch of pairs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import Int
from torch import Tensor

from garden_models.disentanglement.network.config import NetworkConfig
from garden_models.disentanglement.network.model import PointClassifier
from garden_models.disentanglement.training.config import Optimisation
from garden_models.disentanglement.training.described import DescribedShard
from garden_models.disentanglement.training.pair import CONTEXT_POINTS
from garden_models.disentanglement.training.symmetry import symmetry
from garden_models.progress import Progress, silent
from garden_models.training.packing import load_weights
from garden_models.training.schedule import samples_at
from garden_models.training.state import TrainingState
from garden_models.training.steps import continue_training, start_training


def start(network: NetworkConfig, config: Optimisation) -> TrainingState:
    """Return a training before its first step."""
    return start_training(lambda: PointClassifier(network), config)


def train(
    state: TrainingState,
    data: DescribedShard,
    network: NetworkConfig,
    config: Optimisation,
    steps: int,
    progress: Progress = silent,
) -> TrainingState:
    """Return the training ``steps`` steps later (at most to its end)."""
    model = PointClassifier(network).to(config.device)

    def loss_at(step: int) -> Tensor:
        return _loss(model, batch_at(step, data, config), config)

    return continue_training(state, model, loss_at, config, steps, progress)


def trained_model(state: TrainingState, network: NetworkConfig) -> PointClassifier:
    """Return the network of a training."""
    model = PointClassifier(network)
    load_weights(state, model)
    return model


@dataclass(frozen=True)
class Batch:
    """The tensors of one step: see ``PointClassifier``."""

    context: Tensor
    token: Tensor
    assigned: Tensor
    condition: Tensor
    points: Tensor
    label: Tensor
    token_label: Tensor


def batch_at(step: int, data: DescribedShard, config: Optimisation) -> Batch:
    """Return what a step sees: pairs in a new order each epoch, some points of each."""
    chosen = pairs_at(step, len(data), config)
    rng = np.random.default_rng((config.seed, 1, step))
    features = data.features[chosen].astype(np.float32)
    condition = data.condition[chosen].astype(np.float32)
    if config.symmetries:
        for k in range(len(chosen)):
            features[k], condition[k] = symmetry(features[k], condition[k], int(rng.integers(8)))
    label = data.label[chosen]
    asked = np.stack([rng.permutation(features.shape[1])[: config.points] for _ in chosen])
    rows = np.arange(len(chosen))[:, None]
    token = data.token[chosen].astype(np.int64)
    tensors = (
        features[:, :CONTEXT_POINTS],
        token,
        data.assigned[chosen].astype(np.int64),
        condition,
        features[rows, asked],
        label[rows, asked].astype(np.float32),
        label[rows, token].astype(np.float32),
    )
    return Batch(*(torch.from_numpy(np.ascontiguousarray(t)).to(config.device) for t in tensors))


def pairs_at(step: int, count: int, config: Optimisation) -> Int[np.ndarray, " b"]:
    """Return the indices of a step's pairs: every pair once an epoch."""
    return samples_at(step, count, config.batch, config.seed)


def _loss(model: PointClassifier, batch: Batch, config: Optimisation) -> Tensor:
    tokens, places = model.tokens(batch.context, batch.token, batch.assigned, batch.condition)
    logits = model(batch.points, tokens, places)
    loss = F.binary_cross_entropy_with_logits(logits, batch.label)
    if config.token_loss:
        scene = model.scene_logits(tokens)
        loss = loss + config.token_loss * F.binary_cross_entropy_with_logits(
            scene, batch.token_label
        )
    return loss
