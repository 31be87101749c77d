"""Train the point classifier: binary cross-entropy, AdamW, every step a function of its number.

Which pairs and points a step sees follows from its number and the seed alone, so that a
training that is cut anywhere and taken up again ends with the same weights.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import safetensors.torch
import torch
import torch.nn.functional as F
from jaxtyping import Int
from torch import Tensor

from garden_models.disentanglement.network.config import NetworkConfig
from garden_models.disentanglement.network.model import PointClassifier
from garden_models.disentanglement.training.config import Optimisation
from garden_models.disentanglement.training.described import DescribedShard
from garden_models.disentanglement.training.pair import CONTEXT_POINTS
from garden_models.disentanglement.training.state import TrainingState
from garden_models.disentanglement.training.symmetry import symmetry
from garden_models.progress import Progress, silent

_MOMENTS = ("exp_avg", "exp_avg_sq", "step")


def start(network: NetworkConfig, config: Optimisation) -> TrainingState:
    """Return a training before its first step."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(config.seed)
        model = PointClassifier(network)
    return _pack(0, model, _optimiser(model, config), np.zeros(0))


def train(
    state: TrainingState,
    data: DescribedShard,
    network: NetworkConfig,
    config: Optimisation,
    steps: int,
    progress: Progress = silent,
) -> TrainingState:
    """Return the training ``steps`` steps later (at most to its end)."""
    with _deterministic(config.threads):
        model = PointClassifier(network).to(config.device)
        optimiser = _optimiser(model, config)
        _unpack(state, model, optimiser)
        model.train()
        losses = []
        end = min(state.step + steps, config.steps)
        for step in range(state.step, end):
            for group in optimiser.param_groups:
                group["lr"] = config.learning_rate * rate_at(step, config)
            loss = _loss(model, batch_at(step, data, config), config)
            optimiser.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(model.parameters(), 1.0)
            optimiser.step()
            losses.append(float(loss.detach()))
            progress((step + 1) / config.steps, f"step {step + 1}, loss {losses[-1]:.4f}")
        return _pack(end, model, optimiser, np.concatenate([state.losses, losses]))


def trained_model(state: TrainingState, network: NetworkConfig) -> PointClassifier:
    """Return the network of a training."""
    tensors = safetensors.torch.load(state.tensors)
    model = PointClassifier(network)
    model.load_state_dict(
        {k.removeprefix("model."): t for k, t in tensors.items() if k.startswith("model.")}
    )
    return model.eval()


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
    place = step * config.batch + np.arange(config.batch)
    epochs = {int(e): None for e in place // count}
    order = {e: np.random.default_rng((config.seed, 0, e)).permutation(count) for e in epochs}
    return np.array([order[int(p // count)][p % count] for p in place])


def rate_at(step: int, config: Optimisation) -> float:
    """Return the learning rate's factor: a linear rise, then a cosine (or level)."""
    if step < config.warm_up:
        return (step + 1) / config.warm_up
    if not config.decay:
        return 1.0
    left = (step - config.warm_up) / max(config.steps - config.warm_up, 1)
    return float(0.5 * (1 + np.cos(np.pi * left)))


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


def _optimiser(model: PointClassifier, config: Optimisation) -> torch.optim.AdamW:
    return torch.optim.AdamW(
        model.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay
    )


def _pack(
    step: int, model: PointClassifier, optimiser: torch.optim.AdamW, losses: np.ndarray
) -> TrainingState:
    tensors = {f"model.{name}": t for name, t in model.state_dict().items()}
    for name, parameter in model.named_parameters():
        for moment in _MOMENTS:
            if moment in optimiser.state[parameter]:
                tensors[f"{moment}.{name}"] = optimiser.state[parameter][moment]
    packed = {name: t.detach().cpu().contiguous() for name, t in tensors.items()}
    return TrainingState(step, safetensors.torch.save(packed), np.asarray(losses, np.float64))


def _unpack(state: TrainingState, model: PointClassifier, optimiser: torch.optim.AdamW) -> None:
    tensors = safetensors.torch.load(state.tensors)
    model.load_state_dict({name: tensors[f"model.{name}"] for name in model.state_dict()})
    for name, parameter in model.named_parameters():
        if f"step.{name}" in tensors:
            optimiser.state[parameter] = {
                moment: tensors[f"{moment}.{name}"].to(
                    parameter.device if moment != "step" else "cpu"
                )
                for moment in _MOMENTS
            }


@contextmanager
def _deterministic(threads: int) -> Iterator[None]:
    before = torch.get_num_threads(), torch.are_deterministic_algorithms_enabled()
    memory: Any = torch.utils.deterministic
    filled = memory.fill_uninitialized_memory
    torch.set_num_threads(threads)
    torch.use_deterministic_algorithms(True)
    # No kernel here reads memory that none wrote: filling it costs a tenth of a step.
    memory.fill_uninitialized_memory = False
    try:
        yield
    finally:
        torch.set_num_threads(before[0])
        torch.use_deterministic_algorithms(before[1])
        memory.fill_uninitialized_memory = filled
