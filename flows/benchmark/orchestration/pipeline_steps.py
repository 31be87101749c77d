"""The pipeline's functions as steps of ours."""

from __future__ import annotations

from flows.benchmark.orchestration import pipeline
from flows.benchmark.orchestration.pipeline import Change, Signal
from garden_models.scene import Placement
from tasks.step import Step, step


@step(version=1, packages=("numpy",))
def first_placement(seed: int) -> Placement:
    """Return an object's placement with all its hypotheses."""
    return pipeline.first_placement(seed)


@step(version=1, packages=("numpy",))
def nudge(placement: Placement, config: Change) -> Placement:
    """Return the placement with every hypothesis moved a little."""
    return pipeline.nudge(placement, config)


@step(version=1, packages=("numpy",))
def first_signal(seed: int) -> Signal:
    """Return one array."""
    return pipeline.first_signal(seed)


@step(version=1, packages=("numpy",))
def mix(signal: Signal, config: Change) -> Signal:
    """Return the array mixed with itself."""
    return pipeline.mix(signal, config)


STEPS: dict[str, tuple[Step, Step]] = {
    "placement": (first_placement, nudge),
    "array": (first_signal, mix),
}
"""For each chain: what makes its first artifact, and what makes the next of one."""
