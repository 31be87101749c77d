"""Give the learning rate of a step, and which samples it sees, from its number alone."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from jaxtyping import Int


class Schedule(Protocol):
    """What the steps of every training need to know."""

    @property
    def steps(self) -> int: ...  # noqa: D102
    @property
    def learning_rate(self) -> float: ...  # noqa: D102
    @property
    def warm_up(self) -> int: ...  # noqa: D102
    @property
    def decay(self) -> bool: ...  # noqa: D102
    @property
    def weight_decay(self) -> float: ...  # noqa: D102
    @property
    def seed(self) -> int: ...  # noqa: D102
    @property
    def threads(self) -> int: ...  # noqa: D102
    @property
    def device(self) -> str: ...  # noqa: D102


def rate_at(step: int, config: Schedule) -> float:
    """Return the learning rate's factor: a linear rise, then a cosine to nothing (or level)."""
    if step < config.warm_up:
        return (step + 1) / config.warm_up
    if not config.decay:
        return 1.0
    left = (step - config.warm_up) / max(config.steps - config.warm_up, 1)
    return float(0.5 * (1 + np.cos(np.pi * left)))


def samples_at(step: int, count: int, batch: int, seed: int) -> Int[np.ndarray, " b"]:
    """Return the indices of a step's samples: every one of ``count`` once an epoch."""
    place = step * batch + np.arange(batch)
    epochs = {int(e): None for e in place // count}
    order = {e: np.random.default_rng((seed, 0, e)).permutation(count) for e in epochs}
    return np.array([order[int(p // count)][p % count] for p in place])
