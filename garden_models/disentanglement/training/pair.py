"""Define an object-scene pair: a local cloud with exact labels, and the object's mesh samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Float, Int

CONTEXT_POINTS = 2048
"""The first points of a pair: what a network may look at; the rest are only asked about."""


@dataclass(frozen=True)
class Condition:
    """The placed object mesh: points drawn from it, and its triangles, metres.

    ``on`` is the triangle of each point; triangles are counter-clockwise from outside.
    """

    points: Float[np.ndarray, "k 3"]
    on: Int[np.ndarray, " k"]
    triangles: Float[np.ndarray, "t 3 3"]

    @property
    def box(self) -> Float[np.ndarray, "2 3"]:
        """Lowest and highest corner."""
        corners = self.triangles.reshape(-1, 3)
        return np.stack([corners.min(axis=0), corners.max(axis=0)])

    @property
    def size(self) -> float:
        """Longest extent, metres."""
        return float(np.ptp(self.box, axis=0).max())


@dataclass(frozen=True)
class LabelledCloud:
    """Scene points in a box around an object, metres, y down; ``label``: the object's."""

    points: Float[np.ndarray, "n 3"]
    label: Bool[np.ndarray, " n"]

    def subset(self, chosen: np.ndarray) -> LabelledCloud:
        """Return the points that a mask or indices choose."""
        return LabelledCloud(self.points[chosen], self.label[chosen])


@dataclass(frozen=True)
class Pair:
    """One sample: a labelled cloud and the condition, with what evaluation asks about.

    ``support_y`` is the height (y, metres) of the surface that the object stands on;
    ``size`` the object's true longest extent.
    """

    cloud: LabelledCloud
    condition: Condition
    support_y: float
    size: float
    shape: str
    scene: str


@dataclass(frozen=True)
class PairShard:
    """Many pairs of one split, stacked: ``p`` pairs of ``n`` points and ``k`` samples.

    Pair i owns ``triangles[first[i]:first[i + 1]]``.
    """

    SCHEMA: ClassVar[str] = "garden.PairShard/1"
    split: str
    augmented: bool
    points: Float[np.ndarray, "p n 3"]
    label: Bool[np.ndarray, "p n"]
    samples: Float[np.ndarray, "p k 3"]
    on: Int[np.ndarray, "p k"]
    triangles: Float[np.ndarray, "t 3 3"]
    first: Int[np.ndarray, " p_plus_1"]
    support_y: Float[np.ndarray, " p"]
    size: Float[np.ndarray, " p"]
    shapes: tuple[str, ...]
    scenes: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.points)

    def pair(self, index: int) -> Pair:
        """Return one pair."""
        return Pair(
            LabelledCloud(self.points[index], self.label[index]),
            Condition(
                self.samples[index],
                self.on[index],
                self.triangles[self.first[index] : self.first[index + 1]],
            ),
            float(self.support_y[index]),
            float(self.size[index]),
            self.shapes[index],
            self.scenes[index],
        )


def stacked(pairs: list[Pair], split: str, augmented: bool) -> PairShard:
    """Return pairs of equal numbers of points as a shard. Raises ValueError for none."""
    if not pairs:
        raise ValueError("no pair came out: ask for more rooms")
    return PairShard(
        split,
        augmented,
        np.stack([p.cloud.points for p in pairs]).astype(np.float32),
        np.stack([p.cloud.label for p in pairs]),
        np.stack([p.condition.points for p in pairs]).astype(np.float32),
        np.stack([p.condition.on for p in pairs]).astype(np.int32),
        np.concatenate([p.condition.triangles for p in pairs]).astype(np.float32),
        np.cumsum([0, *(len(p.condition.triangles) for p in pairs)]),
        np.array([p.support_y for p in pairs], np.float32),
        np.array([p.size for p in pairs], np.float32),
        tuple(p.shape for p in pairs),
        tuple(p.scene for p in pairs),
    )
