"""Find the targets by their names with an open-vocabulary detector. Seconds a photo on a CPU."""

from __future__ import annotations

from pathlib import Path

from garden_models.progress import Progress, silent
from garden_models.scene import Capture
from garden_models.targets.config import GroundTargets
from garden_models.targets.proposal import TargetProposal
from tasks.model import backend_of, predictor, weights_of
from tasks.step import step


def _weights(config: GroundTargets, **_others: object) -> dict[str, str | Path]:
    return {**weights_of(config.model)}


def _backend(config: GroundTargets, **_others: object) -> str:
    return backend_of(config.model)


@step(
    version=1,
    packages=("numpy", "pillow", "torch", "transformers"),
    backend=_backend,
    weights=_weights,
    cores="all",
    memory_gb=4.0,
)
def ground_targets(
    capture: Capture,
    leave_out: tuple[str, ...],
    config: GroundTargets,
    progress: Progress = silent,
) -> TargetProposal:
    """Return what is found of the configured names; ``leave_out`` are photos to pass over."""
    from garden_models.targets.ground import ground_targets as run

    with predictor(config.model) as ground:
        return run(capture, leave_out, config, ground, progress)
