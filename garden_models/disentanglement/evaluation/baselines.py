"""Label points without a network: by a box, by distance, by connected clusters.

Each baseline has settings; ``chosen`` picks the best of a grid on validation pairs, so that no
baseline is held back by a bad threshold.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool
from scipy.spatial import cKDTree

from garden_models.disentanglement.network.condition_distance import to_condition
from garden_models.disentanglement.network.surroundings import clusters
from garden_models.disentanglement.training.pair import Pair
from garden_models.metrics.classification import Confusion, confusion

Labels = Bool[np.ndarray, " n"]
Rule = Callable[[Pair], Labels]
DISTANCES = (0.002, 0.004, 0.007, 0.01, 0.015, 0.02, 0.03, 0.05, 0.08, 0.12, 0.2, 0.3)
"""Thresholds that are tried, of the mesh's longest extent."""


@dataclass(frozen=True)
class BoxCrop:
    """What lies in the mesh's gravity-aligned box, grown by a share of its extent."""

    grown: float = 0.0

    def __call__(self, pair: Pair) -> Labels:
        """Label one pair."""
        low, high = pair.condition.box
        margin = self.grown * (high - low)
        points = pair.cloud.points
        return np.asarray(((points >= low - margin) & (points <= high + margin)).all(axis=1))


@dataclass(frozen=True)
class NearMesh:
    """What lies within a distance of the mesh's surface."""

    within: float

    def __call__(self, pair: Pair) -> Labels:
        """Label one pair."""
        distance = to_condition(pair.cloud.points, pair.condition).distance
        return np.asarray(distance <= self.within * pair.condition.size)


@dataclass(frozen=True)
class Connected:
    """Clusters of points off the support, of which enough lies near the mesh.

    The support is taken to be the level layer at the mesh's base.
    """

    within: float
    least_share: float
    link_spacings: float = 2.5

    def __call__(self, pair: Pair) -> Labels:
        """Label one pair."""
        points, size = pair.cloud.points, pair.condition.size
        base = pair.condition.box[1, 1]
        on_support = np.abs(points[:, 1] - base) < 0.02 * size
        nearest, _ = cKDTree(points).query(points, k=5)
        reach = self.link_spacings * float(np.median(nearest[:, 4]))
        cluster = clusters(points, on_support, reach)
        near = NearMesh(self.within)(pair)
        kept = cluster >= 0
        if not kept.any():
            return np.zeros(len(points), bool)
        count = np.bincount(cluster[kept])
        share = np.bincount(cluster[kept], near[kept].astype(float)) / count
        labels = np.zeros(len(points), bool)
        labels[kept] = share[cluster[kept]] >= self.least_share
        return labels


GRIDS: dict[str, tuple[Rule, ...]] = {
    "box crop": tuple(BoxCrop(grown) for grown in (-0.05, 0.0, 0.02, 0.05, 0.1)),
    "distance to mesh": tuple(NearMesh(within) for within in DISTANCES),
    "connected components": tuple(
        Connected(within, share)
        for within, share in itertools.product((0.02, 0.05, 0.1, 0.2), (0.3, 0.5, 0.7))
    ),
}


def chosen(rules: Sequence[Rule], pairs: Sequence[Pair]) -> Rule:
    """Return the rule with the best F1 over all points of some pairs."""
    return max(rules, key=lambda rule: pooled(rule, pairs).f1)


def pooled(rule: Rule, pairs: Sequence[Pair]) -> Confusion:
    """Return a rule's counts over all points of some pairs."""
    total = Confusion()
    for pair in pairs:
        total = total + confusion(rule(pair), pair.cloud.label)
    return total
