"""The functions that every peer runs: a chain of steps over one small artifact."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Float

from garden_models.scene import Placement, PlacementHypothesis

HYPOTHESES = 13
"""As many poses as an object of the sample capture has."""

SAMPLES = 512


@dataclass(frozen=True)
class Signal:
    """The simplest small artifact: one array, 4 KB of float64."""

    SCHEMA: ClassVar[str] = "benchmark.Signal/1"
    samples: Float[np.ndarray, " n"]


@dataclass(frozen=True)
class Change:
    """The options of one step."""

    index: int
    share: float = 0.25


@dataclass(frozen=True)
class Chain:
    """``length`` steps, each of which takes the artifact before it and gives the next."""

    name: str
    first: Callable[[int], Any]
    advance: Callable[[Any, Change], Any]
    kind: type
    length: int = 200
    seed: int = 0

    def changes(self) -> list[Change]:
        """Return the options of every step."""
        return [Change(index) for index in range(self.length)]


executed: list[str] = []
"""Which functions really ran: what proves that a hit was one."""


def first_placement(seed: int) -> Placement:
    """Return an object's placement with all its hypotheses: the pipeline's own small artifact."""
    executed.append("first_placement")
    generator = np.random.default_rng(seed)
    hypotheses = tuple(
        PlacementHypothesis(
            f"yaw {index}",
            generator.standard_normal((3, 3)),
            generator.standard_normal(3),
            1.0,
            {"mask_iou": 0.9, "depth_residual_m": 0.01, "support_gap_m": 0.0, "total": 0.8},
        )
        for index in range(HYPOTHESES)
    )
    return Placement("mug", hypotheses, 0, "fits the masks best")


def nudge(placement: Placement, config: Change) -> Placement:
    """Return the placement with every hypothesis moved a little."""
    executed.append("nudge")
    moved = tuple(
        dataclasses.replace(h, translation_gv=h.translation_gv * config.share + config.index)
        for h in placement.hypotheses
    )
    return dataclasses.replace(placement, hypotheses=moved)


def first_signal(seed: int) -> Signal:
    """Return one array."""
    executed.append("first_signal")
    return Signal(np.random.default_rng(seed).standard_normal(SAMPLES))


def mix(signal: Signal, config: Change) -> Signal:
    """Return the array, each sample mixed with one ``index`` places on."""
    executed.append("mix")
    neighbour = np.roll(signal.samples, config.index + 1)
    return Signal((1 - config.share) * signal.samples + config.share * neighbour)


CHAINS = {
    "placement": Chain("placement", first_placement, nudge, Placement),
    "array": Chain("array", first_signal, mix, Signal),
}
