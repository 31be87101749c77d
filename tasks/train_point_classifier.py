"""Train the point classifier for some steps. Minutes, CPU or GPU.

A training is a chain of these: each result is a checkpoint (weights, moments, losses) that is
written whole or not at all, and the next one starts from it. What is killed loses at most one
link and ends with the same weights.
"""

from __future__ import annotations

from garden_models.disentanglement.network.config import NetworkConfig
from garden_models.disentanglement.training.config import Optimisation
from garden_models.disentanglement.training.described import DescribedShard
from garden_models.progress import Progress, silent
from garden_models.training.state import TrainingState
from tasks.step import step


@step(version=1, packages=("torch", "numpy"))
def start_point_classifier(network: NetworkConfig, config: Optimisation) -> TrainingState:
    """Return the training before its first step: seeded weights."""
    from garden_models.disentanglement.training.optimise import start

    return start(network, config)


@step(version=1, packages=("torch", "numpy"), isolated=True)
def train_point_classifier(
    state: TrainingState,
    shards: tuple[DescribedShard, ...],
    network: NetworkConfig,
    config: Optimisation,
    steps: int,
    progress: Progress = silent,
) -> TrainingState:
    """Return the training ``steps`` steps later."""
    from garden_models.disentanglement.training.described import joined
    from garden_models.disentanglement.training.optimise import train

    return train(state, joined(shards), network, config, steps, progress)
