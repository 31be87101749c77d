"""Define how methods scored on one set of pairs, and score baselines and networks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from garden_models.disentanglement.training.pair import Pair, PairShard
from garden_models.progress import Progress, silent

if TYPE_CHECKING:
    from garden_models.disentanglement.evaluation.score import Score


@dataclass(frozen=True)
class MethodScore:
    """One method's numbers: ``row`` is the supplement's table, the others are F1."""

    method: str
    note: str
    row: dict[str, float]
    by_height: dict[str, float]
    by_size: dict[str, float]
    by_family: dict[str, float]


@dataclass(frozen=True)
class MethodScores:
    """The scores of some methods on the same pairs."""

    SCHEMA: ClassVar[str] = "garden.MethodScores/1"
    pairs: int
    points: int
    scores: tuple[MethodScore, ...]


@dataclass(frozen=True)
class ClassifierWeights:
    """A point classifier's checkpoint, as safetensors."""

    SCHEMA: ClassVar[str] = "garden.ClassifierWeights/1"
    data: bytes


def score_baselines(
    validation: tuple[PairShard, ...], test: tuple[PairShard, ...], progress: Progress = silent
) -> MethodScores:
    """Return the baselines' scores, each with the settings that are best on validation."""
    from garden_models.disentanglement.evaluation.baselines import GRIDS, chosen
    from garden_models.disentanglement.evaluation.score import score

    known, asked = pairs_of(validation), pairs_of(test)
    scores = []
    for k, (name, grid) in enumerate(GRIDS.items()):
        progress(k / len(GRIDS), name)
        rule = chosen(grid, known)
        scores.append(_method_score(name, str(rule), score(asked, (rule(p) for p in asked))))
    return _scores(asked, scores)


def score_network(
    weights: ClassifierWeights,
    test: tuple[PairShard, ...],
    threshold: float = 0.5,
    progress: Progress = silent,
) -> MethodScores:
    """Return a network's score. Raises BadInput if the weights do not fit."""
    from garden_models.disentanglement.evaluation.network_labels import probabilities
    from garden_models.disentanglement.evaluation.score import score
    from garden_models.disentanglement.network.checkpoint import from_bytes

    checkpoint = from_bytes(weights.data)
    labels = [
        label
        for shard in test
        for label in probabilities(checkpoint.model, shard, progress) >= threshold
    ]
    asked = pairs_of(test)
    note = f"checkpoint {checkpoint.digest[:12]}"
    return _scores(asked, [_method_score("network", note, score(asked, labels))])


def pairs_of(shards: tuple[PairShard, ...]) -> list[Pair]:
    """Return all pairs of some shards."""
    return [shard.pair(k) for shard in shards for k in range(len(shard))]


def _scores(pairs: list[Pair], scores: list[MethodScore]) -> MethodScores:
    return MethodScores(len(pairs), sum(len(p.cloud.label) for p in pairs), tuple(scores))


def _method_score(name: str, note: str, scored: Score) -> MethodScore:
    return MethodScore(
        name,
        note,
        {key: round(value, 5) for key, value in scored.row().items()},
        {key: round(counts.f1, 5) for key, counts in scored.by_height.items()},
        {key: round(counts.f1, 5) for key, counts in scored.by_size.items()},
        {key: round(counts.f1, 5) for key, counts in scored.by_family.items()},
    )
