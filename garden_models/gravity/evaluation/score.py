"""Score the methods of the gravity table on procedural test scenes."""

from __future__ import annotations

import numpy as np

from garden_models.gravity.evaluation.conditions import Condition
from garden_models.gravity.evaluation.methods import (
    DecoderWeights,
    GravityErrors,
    GravityEstimates,
    run_methods,
    table_methods,
)
from garden_models.gravity.evaluation.procedural import procedural_truth
from garden_models.gravity.training.splits import Split
from garden_models.metrics.gravity import NO_ANSWER_DEG, MethodErrors, angular_error_deg
from garden_models.photo_gravity.photo_gravity import ReadPhotoGravity
from garden_models.progress import Progress, silent


def score_scenes(
    split: Split,
    first: int,
    count: int,
    condition: Condition,
    weights: DecoderWeights,
    ask_geocalib: ReadPhotoGravity | None = None,
    progress: Progress = silent,
) -> GravityErrors:
    """Return every method's error on the scenes ``first`` and following of a split."""
    methods = table_methods(weights, ask_geocalib)
    columns, sigmas, names = [], [], []
    for k in range(count):
        progress(k / count, f"{condition.name}, scene {first + k}")
        truth = procedural_truth(split, first + k, condition)
        found = run_methods(methods, truth.reconstruction)
        columns.append(errors_of(found, truth.down_world))
        sigmas.append(found.sigma_deg)
        names.append(truth.scene)
    return GravityErrors(
        tuple(methods), tuple(names), np.stack(columns, axis=1), np.stack(sigmas, axis=1)
    )


def errors_of(found: GravityEstimates, down_world: np.ndarray) -> np.ndarray:
    """Return the errors in degrees; no answer counts as much as a random one."""
    return np.array(
        [
            NO_ANSWER_DEG if np.isnan(down).any() else angular_error_deg(down, down_world)
            for down in found.down_world
        ]
    )


def joined(parts: tuple[GravityErrors, ...]) -> tuple[MethodErrors, ...]:
    """Return scores of several groups of scenes by the same methods as one row a method."""
    scenes = tuple(scene for part in parts for scene in part.scenes)
    errors = np.concatenate([part.errors_deg for part in parts], axis=1)
    sigmas = np.concatenate([part.sigmas_deg for part in parts], axis=1)
    return tuple(
        MethodErrors(name, scenes, errors[k], sigmas[k]) for k, name in enumerate(parts[0].methods)
    )
