"""Train the gravity decoder for some steps, then calibrate it. Minutes, CPU or GPU.

A training is a chain of checkpoints as the point classifier's: what is killed loses at most
one link and ends with the same weights.
"""

from __future__ import annotations

from garden_models.gravity.decoder.config import DecoderConfig
from garden_models.gravity.training.calibrated import Calibrated
from garden_models.gravity.training.config import GravityOptimisation
from garden_models.gravity.training.shard import EvidenceShard
from garden_models.gravity.training.token_shard import TokenShard
from garden_models.progress import Progress, silent
from garden_models.training.state import TrainingState
from tasks.step import step


@step(version=1, packages=("torch", "numpy"))
def start_gravity_decoder(network: DecoderConfig, config: GravityOptimisation) -> TrainingState:
    """Return the training before its first step: seeded weights."""
    from garden_models.gravity.training.optimise import start

    return start(network, config)


@step(version=1, packages=("torch", "numpy"), isolated=True)
def train_gravity_decoder(
    state: TrainingState,
    shards: tuple[EvidenceShard, ...],
    network: DecoderConfig,
    config: GravityOptimisation,
    steps: int,
    progress: Progress = silent,
) -> TrainingState:
    """Return the training on evidence ``steps`` steps later."""
    from garden_models.gravity.training.optimise import train
    from garden_models.gravity.training.shard import joined

    return train(state, joined(shards), network, config, steps, progress)


@step(version=1, packages=("torch", "numpy"), isolated=True)
def train_gravity_decoder_on_tokens(
    state: TrainingState,
    shards: tuple[TokenShard, ...],
    network: DecoderConfig,
    config: GravityOptimisation,
    steps: int,
    progress: Progress = silent,
) -> TrainingState:
    """Return the training on a backbone's tokens ``steps`` steps later (the paper's)."""
    from garden_models.gravity.training.optimise_tokens import train
    from garden_models.gravity.training.token_shard import joined

    return train(state, joined(shards), network, config, steps, progress)


@step(version=1, packages=("torch", "numpy"), isolated=True)
def calibrate_gravity_decoder(
    state: TrainingState,
    shards: tuple[EvidenceShard, ...],
    network: DecoderConfig,
    progress: Progress = silent,
) -> Calibrated:
    """Return what validation scenes say of the network's claims."""
    from garden_models.gravity.training.calibrating import calibrate_decoder
    from garden_models.gravity.training.optimise import trained_model
    from garden_models.gravity.training.shard import joined

    return calibrate_decoder(trained_model(state, network), joined(shards), progress)
