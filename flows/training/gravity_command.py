"""Do what ``garden train gravity`` asks for."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

from flows.training.gravity import TrainedDecoder, checkpoint_bytes, train, train_on_tokens
from flows.training.gravity_record import Scores, write_record
from flows.training.gravity_scores import score_conditions
from flows.training.gravity_tokens import TokenData, token_shards
from flows.training.run import run_training
from garden_models.gravity.evaluation.conditions import MAIN
from garden_models.gravity.evaluation.methods import DecoderWeights
from garden_models.gravity.training.config import GravityPreset, gravity_preset
from garden_models.scene import BadInput
from storage import Store
from tasks.step import StepEvent

Events = Callable[[StepEvent], None]
Engine = Literal["prefect", "local"]


def decoder_preset(name: str, seed: int = 0, device: str | None = None) -> GravityPreset:
    """Return a preset with another seed or device. Raises BadInput for an unknown name."""
    preset = gravity_preset(name)
    optimisation = dataclasses.replace(preset.optimisation, seed=seed)
    if device:
        optimisation = dataclasses.replace(optimisation, device=device)
    return dataclasses.replace(preset, optimisation=optimisation)


def train_and_score(
    preset: GravityPreset,
    tokens: TokenData | None,
    folder: Path,
    store: Store,
    events: Events,
    engine: Engine,
) -> tuple[dict[str, Any], Scores]:
    """Train, score on test scenes, write the record into ``folder``.

    Raises StepFailed, and BadInput for a preset that reads a backbone's tokens without them.
    """
    if not preset.scenes and tokens is None:
        raise BadInput(
            f"the preset {preset.name} learns from tokens of {preset.network.tokens}: give its "
            "weights with --backbone and data with --data tartanair=FOLDER (hypersim, vkitti2), "
            "or train on procedural scenes with --preset cpu"
        )

    def body() -> tuple[dict[str, Any], Scores]:
        trained, scores = _trained(preset, tokens)
        checkpoint = checkpoint_bytes(trained)
        if trained.calibrated is not None:
            scores = score_conditions(
                MAIN, preset.test_scenes, preset.test_scenes_a_shard, DecoderWeights(checkpoint)
            )
        return write_record(folder, trained, checkpoint, scores), scores

    return run_training(f"train-gravity-{preset.name}", store, events, engine, body)


def _trained(preset: GravityPreset, tokens: TokenData | None) -> tuple[TrainedDecoder, Scores]:
    if tokens is None:
        return train(preset), {}
    return train_on_tokens(preset, token_shards(tokens)), {}
