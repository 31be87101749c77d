"""Compare gravity methods: on procedural scenes, or on one reconstruction. Minutes, CPU."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from garden_models.gravity.evaluation.conditions import Condition
from garden_models.gravity.evaluation.methods import (
    DecoderWeights,
    GravityErrors,
    GravityEstimates,
)
from garden_models.gravity.training.splits import Split
from garden_models.photo_gravity.photo_gravity import ReadPhotoGravity
from garden_models.progress import Progress, silent
from garden_models.scene import Reconstruction
from tasks.model import predictor, weights_of
from tasks.step import step

GEOCALIB = "geocalib"
_PACKAGES = ("torch", "numpy", "scipy", "opencv-python-headless")


def _weights(with_geocalib: bool, **_others: object) -> dict[str, str | Path]:
    """Return GeoCalib's weights, whose content is part of the key."""
    return dict(weights_of(GEOCALIB)) if with_geocalib else {}


@contextmanager
def _geocalib(wanted: bool, progress: Progress) -> Iterator[ReadPhotoGravity | None]:
    if not wanted:
        yield None
        return
    with predictor(GEOCALIB, progress) as predict:
        yield predict


@step(
    version=1,
    packages=_PACKAGES,
    weights=_weights,
    isolated=True,
)
def score_gravity_scenes(
    split: Split,
    first: int,
    scenes: int,
    condition: Condition,
    weights: DecoderWeights,
    with_geocalib: bool = False,
    progress: Progress = silent,
) -> GravityErrors:
    """Return every method's error on procedural scenes of a condition."""
    from garden_models.gravity.evaluation.score import score_scenes

    with _geocalib(with_geocalib, progress) as ask:
        return score_scenes(split, first, scenes, condition, weights, ask, progress)


@step(
    version=1,
    packages=_PACKAGES,
    weights=_weights,
    isolated=True,
)
def estimate_gravity(
    reconstruction: Reconstruction, weights: DecoderWeights, with_geocalib: bool = False
) -> GravityEstimates:
    """Return what every method says of one reconstruction."""
    from garden_models.gravity.evaluation.methods import run_methods, table_methods

    with _geocalib(with_geocalib, silent) as ask:
        return run_methods(table_methods(weights, ask), reconstruction)
