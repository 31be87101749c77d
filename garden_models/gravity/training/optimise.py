"""Train the Gravity-View decoder on evidence: tokens are written anew in every start frame."""

from __future__ import annotations

from torch import Tensor

from garden_models.gravity.decoder.config import DecoderConfig
from garden_models.gravity.decoder.loss import decoder_loss
from garden_models.gravity.decoder.network import GravityViewDecoder
from garden_models.gravity.decoder.tokens import view_tokens
from garden_models.gravity.training.batch import batch_at
from garden_models.gravity.training.config import GravityOptimisation
from garden_models.gravity.training.shard import EvidenceShard
from garden_models.progress import Progress, silent
from garden_models.training.packing import load_weights
from garden_models.training.state import TrainingState
from garden_models.training.steps import continue_training, start_training


def start(network: DecoderConfig, config: GravityOptimisation) -> TrainingState:
    """Return a training before its first step."""
    return start_training(lambda: GravityViewDecoder(network), config)


def train(
    state: TrainingState,
    data: EvidenceShard,
    network: DecoderConfig,
    config: GravityOptimisation,
    steps: int,
    progress: Progress = silent,
) -> TrainingState:
    """Return the training ``steps`` steps later (at most to its end)."""
    model = GravityViewDecoder(network).to(config.device)

    def loss_at(step: int) -> Tensor:
        batch = batch_at(step, data, config)
        found = model(view_tokens(batch.evidence, batch.start), batch.reference)
        return decoder_loss(found, batch.true)

    return continue_training(state, model, loss_at, config, steps, progress)


def trained_model(state: TrainingState, network: DecoderConfig) -> GravityViewDecoder:
    """Return the network of a training."""
    model = GravityViewDecoder(network)
    load_weights(state, model)
    return model
