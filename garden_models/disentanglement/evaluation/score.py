"""Score labellings on pairs: in all, by height above the support, by the object's size."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool

from garden_models.disentanglement.training.pair import Pair
from garden_models.metrics.classification import Confusion, confusion

NEAR_SUPPORT_M = 0.02
HEIGHTS_M = (0.0, 0.02, 0.05, 0.1, 0.3, np.inf)
SIZES_M = (0.0, 0.1, 0.2, 0.5, 1.0, np.inf)


@dataclass(frozen=True)
class Score:
    """Counts over all points, and by range of height and of size (``"0.02-0.05 m"``)."""

    total: Confusion
    near_support: Confusion
    by_height: dict[str, Confusion]
    by_size: dict[str, Confusion]
    by_family: dict[str, Confusion]
    mean_f1: float
    """Mean over pairs, where each counts alike."""

    def row(self) -> dict[str, float]:
        """Return the numbers of the supplement's table, and the two that the issue asks for."""
        total = self.total
        return {
            "F1": total.f1,
            "IoU": total.iou,
            "accuracy": total.accuracy,
            "precision": total.precision,
            "recall": total.recall,
            "F1 within 2 cm of the support": self.near_support.f1,
            "mean F1 of pairs": self.mean_f1,
        }


def score(pairs: Sequence[Pair], labels: Iterable[Bool[np.ndarray, " n"]]) -> Score:
    """Return the score of labels against the pairs' own."""
    total, near_support = Confusion(), Confusion()
    by_height = {name: Confusion() for name in _names(HEIGHTS_M)}
    by_size = {name: Confusion() for name in _names(SIZES_M)}
    by_family: dict[str, Confusion] = {}
    f1 = []
    for pair, claimed in zip(pairs, labels, strict=True):
        truth = pair.cloud.label
        counts = confusion(claimed, truth)
        total, size = total + counts, _bin(np.array([pair.size]), SIZES_M)[0]
        f1.append(counts.f1)
        by_size[_names(SIZES_M)[size]] += counts
        family = pair.shape.partition("/")[0]
        by_family[family] = by_family.get(family, Confusion()) + counts
        height = np.abs(pair.cloud.points[:, 1] - pair.support_y)
        close = height <= NEAR_SUPPORT_M
        near_support = near_support + confusion(claimed[close], truth[close])
        bins = _bin(height, HEIGHTS_M)
        for k, name in enumerate(_names(HEIGHTS_M)):
            by_height[name] += confusion(claimed[bins == k], truth[bins == k])
    return Score(
        total, near_support, by_height, by_size, dict(sorted(by_family.items())), float(np.mean(f1))
    )


def _bin(values: np.ndarray, edges: Sequence[float]) -> np.ndarray:
    return np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)


def _names(edges: Sequence[float]) -> list[str]:
    return [
        f"{low:g}-{high:g} m" if np.isfinite(high) else f"over {low:g} m"
        for low, high in itertools.pairwise(edges)
    ]
