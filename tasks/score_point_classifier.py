"""Score the point classifier, and what needs no training, on the same pairs. A minute, CPU."""

from __future__ import annotations

from garden_models.disentanglement.evaluation.method_scores import (
    ClassifierWeights,
    MethodScores,
)
from garden_models.disentanglement.training.pair import PairShard
from garden_models.progress import Progress, silent
from tasks.step import step


@step(version=1, packages=("numpy", "scipy"), isolated=True)
def score_baselines(
    validation: tuple[PairShard, ...], test: tuple[PairShard, ...], progress: Progress = silent
) -> MethodScores:
    """Return the scores of box crop, distance and connectivity."""
    from garden_models.disentanglement.evaluation.method_scores import score_baselines as run

    return run(validation, test, progress)


@step(version=1, packages=("torch", "numpy", "scipy"), isolated=True)
def score_point_classifier(
    weights: ClassifierWeights, test: tuple[PairShard, ...], progress: Progress = silent
) -> MethodScores:
    """Return the network's score."""
    from garden_models.disentanglement.evaluation.method_scores import score_network

    return score_network(weights, test, progress=progress)
