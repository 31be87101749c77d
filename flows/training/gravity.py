"""Train the gravity decoder: shards of scenes, a chain of checkpoints, a calibration."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from flows.training.chain import checkpoints, each
from garden_models.gravity.training.calibrated import Calibrated
from garden_models.gravity.training.config import GravityPreset
from garden_models.gravity.training.splits import Split
from garden_models.training.state import TrainingState
from tasks.make_gravity_scenes import make_gravity_scenes
from tasks.step import Ref, load
from tasks.train_gravity_decoder import (
    calibrate_gravity_decoder,
    start_gravity_decoder,
    train_gravity_decoder,
    train_gravity_decoder_on_tokens,
)


@dataclass(frozen=True)
class TrainedDecoder:
    """References to all that a training made; a decoder of a backbone's tokens is not
    calibrated.
    """

    preset: GravityPreset
    data: tuple[Ref, ...]
    validation: tuple[Ref, ...]
    states: tuple[Ref, ...]
    calibrated: Ref | None

    @property
    def state(self) -> Ref:
        """The last checkpoint."""
        return self.states[-1]


def train(preset: GravityPreset) -> TrainedDecoder:
    """Train by a preset, or find the training in the store. Raises StepFailed."""
    data = shards("train", preset.scenes, preset)
    states = checkpoints(
        start_gravity_decoder(preset.network, preset.optimisation),
        lambda state, steps, label: train_gravity_decoder(
            state, data, preset.network, preset.optimisation, steps, label=label
        ),
        preset.optimisation.steps,
        preset.checkpoint_every,
    )
    validation = shards("validation", preset.validation_scenes, preset)
    calibrated = calibrate_gravity_decoder(states[-1], validation, preset.network)
    return TrainedDecoder(preset, data, validation, states, calibrated)


def train_on_tokens(preset: GravityPreset, tokens: tuple[Ref, ...]) -> TrainedDecoder:
    """Train the paper's network on a backbone's tokens. Raises StepFailed."""
    states = checkpoints(
        start_gravity_decoder(preset.network, preset.optimisation),
        lambda state, steps, label: train_gravity_decoder_on_tokens(
            state, tokens, preset.network, preset.optimisation, steps, label=label
        ),
        preset.optimisation.steps,
        preset.checkpoint_every,
    )
    return TrainedDecoder(preset, tokens, (), states, None)


def shards(split: Split, scenes: int, preset: GravityPreset) -> tuple[Ref, ...]:
    """Make a split's scenes, some a shard."""
    size = preset.scenes_a_shard

    def make(first: int) -> Ref:
        count = min(size, scenes - first)
        return make_gravity_scenes(split, first, count, label=f"{split} {first}")

    return each(make, range(0, scenes, size))


def checkpoint_bytes(trained: TrainedDecoder) -> bytes:
    """Return a training's network as safetensors; the same training gives the same bytes."""
    from garden_models.gravity.decoder.checkpoint import to_bytes
    from garden_models.gravity.training.optimise import trained_model

    state: TrainingState = load(trained.state, TrainingState)
    known: Calibrated | None = None
    if trained.calibrated is not None:
        known = load(trained.calibrated, Calibrated)
    record = {
        "preset": trained.preset.name,
        "steps": state.step,
        "optimisation": dataclasses.asdict(trained.preset.optimisation),
        "data": [ref.content for ref in trained.data],
        "validation": [ref.content for ref in trained.validation],
    }
    return to_bytes(
        trained_model(state, trained.preset.network),
        None if known is None else known.calibration,
        None if known is None else known.familiarity,
        record,
    )
