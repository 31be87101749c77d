"""Do what ``garden train point-classifier`` and ``garden benchmark classifier`` ask for."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

from flows.training.point_classifier import (
    ablations,
    checkpoint_bytes,
    evaluate,
    evaluation_pairs,
    train,
)
from flows.training.record import write_record
from flows.training.run import run_training
from garden_models.disentanglement.evaluation.method_scores import ClassifierWeights, MethodScores
from garden_models.disentanglement.training.config import TrainingPreset, training_preset
from storage import Store
from tasks.step import StepEvent

Events = Callable[[StepEvent], None]
Engine = Literal["prefect", "local"]
Scores = dict[str, MethodScores]


def classifier_preset(name: str, seed: int = 0, device: str | None = None) -> TrainingPreset:
    """Return a preset with another seed or device. Raises BadInput for an unknown name."""
    preset = training_preset(name)
    optimisation = dataclasses.replace(preset.optimisation, seed=seed)
    if device:
        optimisation = dataclasses.replace(optimisation, device=device)
    return dataclasses.replace(preset, optimisation=optimisation)


def train_and_score(
    preset: TrainingPreset, folder: Path, store: Store, events: Events, engine: Engine
) -> tuple[dict[str, Any], Scores]:
    """Train, score on held-out pairs, write the record into ``folder``. Raises StepFailed."""

    def body() -> tuple[dict[str, Any], Scores]:
        trained = train(preset)
        checkpoint = checkpoint_bytes(trained)
        pairs = evaluation_pairs(preset)
        scores = evaluate(ClassifierWeights(checkpoint), pairs)
        return write_record(folder, trained, checkpoint, pairs, scores), scores

    return run_training(f"train-{preset.name}", store, events, engine, body)


def score_checkpoint(
    preset: TrainingPreset, weights: bytes | None, store: Store, events: Events
) -> Scores:
    """Score a checkpoint (or the baselines alone) on a preset's held-out pairs."""

    def body() -> Scores:
        known = None if weights is None else ClassifierWeights(weights)
        return evaluate(known, evaluation_pairs(preset))

    return run_training("benchmark-classifier", store, events, "local", body)


def score_ablations(preset: TrainingPreset, store: Store, events: Events) -> list[dict[str, Any]]:
    """Train without each augmentation in turn and score all on the same held-out pairs."""

    def body() -> list[dict[str, Any]]:
        pairs = evaluation_pairs(preset)
        rows = []
        for name, changed in ablations(preset).items():
            weights = ClassifierWeights(checkpoint_bytes(train(changed)))
            for setting, scores in evaluate(weights, pairs).items():
                rows.append({"trained with": name, "setting": setting, **scores.scores[0].row})
        return rows

    return run_training("ablate-classifier", store, events, "local", body)
