"""Say all that it takes to load one model here, and what tells it from another."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from garden_models import foundation
from tasks.model.settings import Dtype, device_of, model_settings
from tasks.model.weights import stamp_of


@dataclass(frozen=True)
class Launch:
    """One model on one device. ``stamp`` changes when its weight files do; a model with
    ``own_process`` runs in a worker, also with the Python of whoever asks it.
    """

    name: str
    module: str
    weights: Path
    device: str
    python: tuple[str, ...] | None
    time_limit_s: float
    memory_limit_gb: float | None
    dtype: Dtype
    stamp: str
    own_process: bool = False


def launch_of(name: str) -> Launch:
    """Return how a model is loaded; BadInput if it cannot be, with what is missing."""
    settings = model_settings(name)
    return Launch(
        name=name,
        module=foundation.ADAPTERS[name],
        weights=settings.weights,
        device=device_of(name, settings),
        python=settings.python,
        time_limit_s=settings.time_limit_s,
        memory_limit_gb=settings.memory_limit_gb,
        dtype=settings.dtype,
        stamp=stamp_of(name),
        own_process=foundation.card(name).own_process,
    )


def launch_to_json(launch: Launch) -> dict[str, Any]:
    """Return a launch as plain JSON."""
    return dataclasses.asdict(launch) | {"weights": str(launch.weights)}


def launch_from_json(document: dict[str, Any]) -> Launch:
    """Read what ``launch_to_json`` gave."""
    python = document["python"]
    return Launch(
        **document
        | {
            "weights": Path(document["weights"]),
            "python": None if python is None else tuple(python),
        }
    )
