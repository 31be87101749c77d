"""Run a tiny training as its own process: ``-m tests.flows.training.tiny_training STORE OUT``."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

from flows.training.command import train_and_score
from garden_models.disentanglement.network.config import NetworkConfig
from garden_models.disentanglement.training.config import SMOKE, Optimisation
from storage import Store
from tasks.step import StepEvent

TINY = dataclasses.replace(
    SMOKE,
    name="tiny",
    rooms=1,
    validation_rooms=1,
    test_rooms=1,
    rooms_a_shard=1,
    checkpoint_every=2,
    network=NetworkConfig(
        width=16, heads=2, token_layers=1, point_layers=1, scene_tokens=32, object_tokens=16
    ),
    optimisation=Optimisation(steps=6, batch=2, warm_up=2, points=64, threads=1),
)


def say(event: StepEvent) -> None:
    """Tell the parent what is finished."""
    if event.kind == "finished":
        print(event.step, event.label, event.outcome, flush=True)


if __name__ == "__main__":
    store = Store.open(Path(sys.argv[1]), create=True)
    train_and_score(TINY, Path(sys.argv[2]), store, say, "local")
