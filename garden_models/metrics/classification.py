"""Score binary labels: F1, IoU, accuracy, precision and recall from pooled counts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool


@dataclass(frozen=True)
class Confusion:
    """Counts of points; they add up over samples."""

    true_positive: int = 0
    false_positive: int = 0
    false_negative: int = 0
    true_negative: int = 0

    def __add__(self, other: Confusion) -> Confusion:
        return Confusion(
            self.true_positive + other.true_positive,
            self.false_positive + other.false_positive,
            self.false_negative + other.false_negative,
            self.true_negative + other.true_negative,
        )

    @property
    def f1(self) -> float:
        """Harmonic mean of precision and recall; 1 where there is nothing to find or claim."""
        return _ratio(2 * self.true_positive, self.false_positive + self.false_negative)

    @property
    def iou(self) -> float:
        """Intersection of claimed and true positives over their union."""
        return _ratio(self.true_positive, self.false_positive + self.false_negative)

    @property
    def accuracy(self) -> float:
        """Share of points with the right label."""
        right = self.true_positive + self.true_negative
        return _ratio(right, self.false_positive + self.false_negative)

    @property
    def precision(self) -> float:
        """Share of the claimed positives that are right."""
        return _ratio(self.true_positive, self.false_positive)

    @property
    def recall(self) -> float:
        """Share of the true positives that are claimed."""
        return _ratio(self.true_positive, self.false_negative)


def confusion(claimed: Bool[np.ndarray, "..."], truth: Bool[np.ndarray, "..."]) -> Confusion:
    """Return the counts of labels against the truth. Raises ValueError for other shapes."""
    if claimed.shape != truth.shape:
        raise ValueError(f"expected labels of one shape, got {claimed.shape} and {truth.shape}")
    return Confusion(
        int(np.count_nonzero(claimed & truth)),
        int(np.count_nonzero(claimed & ~truth)),
        int(np.count_nonzero(~claimed & truth)),
        int(np.count_nonzero(~claimed & ~truth)),
    )


def _ratio(good: int, bad: int) -> float:
    return good / (good + bad) if good + bad else 1.0
