"""Train the Gravity-View decoder on a backbone's tokens, as the paper does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from garden_models.gravity.decoder.config import DecoderConfig
from garden_models.gravity.decoder.loss import decoder_loss
from garden_models.gravity.decoder.network import GravityViewDecoder
from garden_models.gravity.training.config import GravityOptimisation
from garden_models.gravity.training.token_shard import TokenShard, check_shard
from garden_models.progress import Progress, silent
from garden_models.training.state import TrainingState
from garden_models.training.steps import continue_training


@dataclass(frozen=True)
class TokenBatch:
    """Tokens (b, views, c), which are ``present``, the reference view, and the truth of it."""

    tokens: Tensor
    present: Tensor
    reference: Tensor
    true: Tensor


def train(
    state: TrainingState,
    data: TokenShard,
    network: DecoderConfig,
    config: GravityOptimisation,
    steps: int,
    progress: Progress = silent,
) -> TrainingState:
    """Return the training ``steps`` steps later. Raises BadInput for tokens that do not fit."""
    check_shard(data, network.tokens, network.token_width)
    model = GravityViewDecoder(network).to(config.device)

    def loss_at(step: int) -> Tensor:
        batch = batch_at(step, data, config)
        return decoder_loss(model(batch.tokens, batch.reference, batch.present), batch.true)

    return continue_training(state, model, loss_at, config, steps, progress)


def batch_at(step: int, data: TokenShard, config: GravityOptimisation) -> TokenBatch:
    """Return the batch of a step: random scenes until their tokens would exceed the budget.

    The backbone has seen all views of a scene together, so a scene comes whole.
    """
    rng = np.random.default_rng((config.seed, 1, step))
    chosen: list[int] = []
    tokens = 0
    for k in rng.permutation(len(data)):
        views = int(data.views[k])
        if chosen and tokens + views > config.tokens_a_batch:
            break
        chosen.append(int(k))
        tokens += views
    most = max(int(data.views[k]) for k in chosen)
    values = np.zeros((len(chosen), most, data.tokens.shape[1]), np.float32)
    present = np.zeros((len(chosen), most), dtype=bool)
    true = np.zeros((len(chosen), 3, 3), np.float32)
    for row, k in enumerate(chosen):
        rows = slice(int(data.start[k]), int(data.start[k + 1]))
        values[row, : data.views[k]] = data.tokens[rows]
        present[row, : data.views[k]] = True
        true[row] = data.gv_from_camera[rows][data.reference[k]]
    reference = torch.from_numpy(data.reference[chosen].astype(np.int64))
    arrays = (values, present, true)
    values_t, present_t, true_t = (torch.from_numpy(a).to(config.device) for a in arrays)
    return TokenBatch(values_t, present_t, reference.to(config.device), true_t)
