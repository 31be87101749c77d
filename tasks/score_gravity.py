"""Compare gravity methods: on procedural scenes, or on one reconstruction. Minutes, CPU."""

from __future__ import annotations

from pathlib import Path

from garden_models.gravity.evaluation.conditions import Condition
from garden_models.gravity.evaluation.methods import (
    DecoderWeights,
    GravityErrors,
    GravityEstimates,
)
from garden_models.gravity.training.splits import Split
from garden_models.progress import Progress, silent
from garden_models.scene import BadInput, Reconstruction
from tasks.step import step

_PACKAGES = ("torch", "numpy", "scipy", "opencv-python-headless")


def _weights(geocalib: str, **_others: object) -> dict[str, str | Path]:
    """Return GeoCalib's weights, whose content is part of the key."""
    if not geocalib:
        return {}
    path = Path(geocalib)
    if not path.is_file():
        raise BadInput(f"no such GeoCalib weights: {path}")
    return {"geocalib": path}


@step(
    version=1,
    packages=_PACKAGES,
    weights=_weights,
    skip=("geocalib",),
    isolated=True,
)
def score_gravity_scenes(
    split: Split,
    first: int,
    scenes: int,
    condition: Condition,
    weights: DecoderWeights,
    geocalib: str = "",
    progress: Progress = silent,
) -> GravityErrors:
    """Return every method's error on procedural scenes of a condition."""
    from garden_models.gravity.evaluation.score import score_scenes

    return score_scenes(split, first, scenes, condition, weights, geocalib, progress)


@step(
    version=1,
    packages=_PACKAGES,
    weights=_weights,
    skip=("geocalib",),
    isolated=True,
)
def estimate_gravity(
    reconstruction: Reconstruction, weights: DecoderWeights, geocalib: str = ""
) -> GravityEstimates:
    """Return what every method says of one reconstruction."""
    from garden_models.gravity.evaluation.methods import run_methods, table_methods

    return run_methods(table_methods(weights, geocalib), reconstruction)
