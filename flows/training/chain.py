"""Run the steps of a training: shards side by side, checkpoints one after the other."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

from tasks.step import Ref, StepFailed, fan_out

T = TypeVar("T")


def each(function: Callable[[T], Ref], items: Iterable[T]) -> tuple[Ref, ...]:
    """Run a step for every item at the same time; raise the first failure (StepFailed)."""
    results = fan_out(function, items)
    for result in results:
        if isinstance(result, StepFailed):
            raise result
    return tuple(result for result in results if isinstance(result, Ref))


def checkpoints(
    start: Ref, link: Callable[[Ref, int, str], Ref], total: int, every: int
) -> tuple[Ref, ...]:
    """Return the checkpoints of a training of ``total`` steps, one after ``every`` steps.

    ``link`` makes a checkpoint from the one before, a number of steps and a label.
    """
    states = [start]
    for done in range(0, total, every):
        steps = min(every, total - done)
        states.append(link(states[-1], steps, f"to step {done + steps}"))
    return tuple(states)
