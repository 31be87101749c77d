"""Take a collection through its steps model by model, so that each is loaded for many scenes.

A scene stops before the first step that asks another model, and lets the scenes of its wave
catch up; the next pass finds in the store what the last one made. A wave is as many scenes as
share a load: a larger one loads less often, a smaller one finishes its first scenes sooner.
"""

from __future__ import annotations

from typing import Any

from flows.licence import models_in
from flows.preset import Preset

WAVE = 32

STEP_OF = {
    "geometry": "predict_geometry",
    "reconstruct": "reconstruct",
    "gravity": "align_gravity",
    "ground": "ground_targets",
    "segment": "segment",
    "mesh": "mesh_object",
    "place": "place_object",
}
"""The steps that may ask a model by the preset's option, in the order of a scene."""

Priority = tuple[int, int, int]


def stops_of(preset: Preset) -> tuple[str, ...]:
    """Return the steps before which a scene waits for the others: where its model changes."""
    stops: list[str] = []
    last: tuple[str, ...] = ()
    for option, step in STEP_OF.items():
        models = models_in(getattr(preset, option))
        if models and last and models != last:
            stops.append(step)
        last = models or last
    return tuple(stops)


def priority(position: int, passed: int, stops: tuple[str, ...]) -> Priority:
    """Return a scene's place in the queue: waves in order, and in each the first passes first.

    ``position`` is its place in the collection, ``passed`` how many passes it has made.
    """
    return (position // WAVE if stops else 0, passed, position)


def postponed(stops: tuple[str, ...], passed: int) -> tuple[str, ...]:
    """Return the steps that the next pass leaves to later ones."""
    return stops[passed:]


def passes_made(stops: tuple[str, ...], report: dict[str, Any]) -> int:
    """Return how many passes a scene has made that stopped before ``report["postponed"]``."""
    return stops.index(report["postponed"]) + 1
