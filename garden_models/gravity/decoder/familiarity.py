"""Tell tokens that are like those learned from, from tokens of something else."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

LARGEST = 10.0
MARGIN = 1.25
"""How much stranger than the strangest validation scene is still taken."""
LEAST_SPREAD = 0.02


@dataclass(frozen=True)
class Familiarity:
    """Mean and spread of every entry of the tokens learned from, and the largest mean
    deviation (in spreads) that is still taken for one of them.
    """

    mean: tuple[float, ...]
    spread: tuple[float, ...]
    limit: float

    def strangeness(self, tokens: Float[np.ndarray, "views width"]) -> float:
        """Return the mean deviation over the limit: above 1 is something else."""
        return _deviation(tokens, np.array(self.mean), np.array(self.spread)) / self.limit


def learn_familiarity(scenes: list[Float[np.ndarray, "views width"]]) -> Familiarity:
    """Return what tokens of known scenes look like."""
    rows = np.concatenate(scenes)
    mean, spread = rows.mean(axis=0), np.maximum(rows.std(axis=0), LEAST_SPREAD)
    worst = max(_deviation(tokens, mean, spread) for tokens in scenes)
    return Familiarity(_rounded(mean), _rounded(spread), MARGIN * worst)


def _rounded(values: np.ndarray) -> tuple[float, ...]:
    return tuple(float(f"{v:.5g}") for v in values)


def _deviation(tokens: np.ndarray, mean: np.ndarray, spread: np.ndarray) -> float:
    return float(np.minimum(np.abs(tokens - mean) / spread, LARGEST).mean())
