"""Train the point classifier: shards of pairs, a chain of checkpoints, scores beside baselines."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

from flows.training.chain import checkpoints, each
from garden_models.disentanglement.evaluation.method_scores import ClassifierWeights, MethodScores
from garden_models.disentanglement.training.augmentations.config import NAMES, NONE, without
from garden_models.disentanglement.training.config import TrainingPreset
from garden_models.disentanglement.training.pairs_config import PairsConfig
from garden_models.disentanglement.training.splits import Split
from garden_models.training.state import TrainingState
from tasks.describe_training_pairs import describe_training_pairs
from tasks.make_training_pairs import make_training_pairs
from tasks.score_point_classifier import score_baselines, score_point_classifier
from tasks.step import Ref, load
from tasks.train_point_classifier import start_point_classifier, train_point_classifier


@dataclass(frozen=True)
class TrainedClassifier:
    """References to all that a training made."""

    preset: TrainingPreset
    pairs: tuple[Ref, ...]
    described: tuple[Ref, ...]
    states: tuple[Ref, ...]

    @property
    def state(self) -> Ref:
        """The last checkpoint."""
        return self.states[-1]


@dataclass(frozen=True)
class EvaluationPairs:
    """References to the pairs of one setting: for choosing thresholds, and for the score."""

    validation: tuple[Ref, ...]
    test: tuple[Ref, ...]


def train(preset: TrainingPreset) -> TrainedClassifier:
    """Train by a preset, or find the training in the store. Raises StepFailed."""
    pairs = shards("train", "augmented", preset.rooms, preset, preset.pairs)
    described = each(lambda shard: describe_training_pairs(shard, preset.network), pairs)
    states = checkpoints(
        start_point_classifier(preset.network, preset.optimisation),
        lambda state, steps, label: train_point_classifier(
            state, described, preset.network, preset.optimisation, steps, label=label
        ),
        preset.optimisation.steps,
        preset.checkpoint_every,
    )
    return TrainedClassifier(preset, pairs, described, states)


def shards(
    split: Split, setting: str, rooms: int, preset: TrainingPreset, config: PairsConfig
) -> tuple[Ref, ...]:
    """Make a split's pairs, some rooms a shard."""
    starts = range(0, rooms, preset.rooms_a_shard)

    def make(start: int) -> Ref:
        count = min(preset.rooms_a_shard, rooms - start)
        return make_training_pairs(
            split, start, count, config, preset.packages, label=f"{split} {setting} {start}"
        )

    return each(make, starts)


def evaluation_pairs(preset: TrainingPreset) -> dict[str, EvaluationPairs]:
    """Make the held-out pairs: clean; augmented as in training (supplement B: the same pipeline
    for training and test); and with every augmentation at once, at full strength.
    """
    own = preset.pairs.augmentations
    jitter = dataclasses.replace(own.mesh_jitter, gentle=0.0)
    full = dataclasses.replace(own, each=1.0, mesh_jitter=jitter)
    configs = {
        "clean": dataclasses.replace(preset.pairs, augmentations=NONE, augmented=0.0),
        "augmented": dataclasses.replace(preset.pairs, augmented=1.0),
        "full strength": dataclasses.replace(preset.pairs, augmentations=full, augmented=1.0),
    }
    return {
        setting: EvaluationPairs(
            shards("validation", setting, preset.validation_rooms, preset, config),
            shards("test", setting, preset.test_rooms, preset, config),
        )
        for setting, config in configs.items()
    }


def evaluate(
    weights: ClassifierWeights | None, pairs: dict[str, EvaluationPairs]
) -> dict[str, MethodScores]:
    """Score a network (if there is one) and the baselines, by setting."""
    scores = {}
    for setting, asked in pairs.items():
        rows = load(score_baselines(asked.validation, asked.test, label=setting), MethodScores)
        if weights is not None:
            own = load(score_point_classifier(weights, asked.test, label=setting), MethodScores)
            rows = dataclasses.replace(rows, scores=own.scores + rows.scores)
        scores[setting] = rows
    return scores


def checkpoint_bytes(trained: TrainedClassifier) -> bytes:
    """Return a training's network as safetensors; the same training gives the same bytes."""
    from garden_models.disentanglement.network.checkpoint import to_bytes
    from garden_models.disentanglement.training.optimise import trained_model

    state: TrainingState = load(trained.state, TrainingState)
    record = {
        "preset": trained.preset.name,
        "steps": state.step,
        "optimisation": dataclasses.asdict(trained.preset.optimisation),
        "pairs": dataclasses.asdict(trained.preset.pairs),
        "data": [ref.content for ref in trained.pairs],
    }
    return to_bytes(trained_model(state, trained.preset.network), record)


def ablations(preset: TrainingPreset) -> dict[str, TrainingPreset]:
    """Return small trainings that differ in augmentations only."""
    full = dataclasses.replace(preset.pairs.augmentations, each=1.0)
    changed: dict[str, Any] = {"all": full}
    changed |= {f"without {name.replace('_', ' ')}": without(full, name) for name in NAMES}
    changed["none"] = NONE
    return {
        name: dataclasses.replace(
            preset,
            name=f"{preset.name}, {name}",
            pairs=dataclasses.replace(
                preset.pairs,
                augmentations=augmentations,
                augmented=0.0 if name == "none" else preset.pairs.augmented,
            ),
        )
        for name, augmentations in changed.items()
    }
