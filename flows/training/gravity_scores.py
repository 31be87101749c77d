"""Score gravity methods on procedural test scenes, some scenes a step."""

from __future__ import annotations

from collections.abc import Iterable

from flows.training.chain import each
from garden_models.gravity.evaluation.conditions import CURVES, Condition
from garden_models.gravity.evaluation.methods import DecoderWeights, GravityErrors
from garden_models.gravity.evaluation.score import joined
from garden_models.metrics.gravity import MethodErrors
from tasks.score_gravity import score_gravity_scenes
from tasks.step import load

Scored = tuple[MethodErrors, ...]


def score_conditions(
    conditions: Iterable[Condition],
    scenes: int,
    scenes_a_step: int,
    weights: DecoderWeights,
    with_geocalib: bool = False,
) -> dict[str, Scored]:
    """Return every method's errors on the test split, by condition. Raises StepFailed."""
    jobs = [(c, first) for c in conditions for first in range(0, scenes, scenes_a_step)]
    refs = each(
        lambda job: score_gravity_scenes(
            "test",
            job[1],
            min(scenes_a_step, scenes - job[1]),
            job[0],
            weights,
            with_geocalib,
            label=f"{job[0].name} {job[1]}",
        ),
        jobs,
    )
    parts: dict[str, list[GravityErrors]] = {}
    for (condition, _), ref in zip(jobs, refs, strict=True):
        parts.setdefault(condition.name, []).append(load(ref, GravityErrors))
    return {name: joined(tuple(found)) for name, found in parts.items()}


def score_curves(
    scenes: int, scenes_a_step: int, weights: DecoderWeights, with_geocalib: bool = False
) -> dict[str, dict[str, Scored]]:
    """Return the errors along each robustness curve, by curve and condition."""
    return {
        curve: score_conditions(conditions, scenes, scenes_a_step, weights, with_geocalib)
        for curve, conditions in CURVES.items()
    }
