"""Configure the dense reconstruction."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class DenseStereo:
    """Settings of ``densify``. Lengths are in pixels of the working size unless said."""

    long_side: int = 504
    """Working size (the paper's)."""
    partners: int = 5
    """Photos that each photo is compared with."""
    best_partners: int = 3
    """Of these, how many a pixel's cost averages: the others may not see it."""
    range_margin: float = 0.25
    """Share by which the depth range of the sparse points is widened, nearer and farther."""
    max_planes: int = 160
    """Most inverse depths that the coarse sweep tries."""
    small_step: float = 0.06
    large_step: float = 0.6
    edge_scale: float = 0.03
    """Semi-global matching on the coarse sweep: see ``semi_global``."""
    max_relative: float = 0.01
    max_disagreement_px: float = 1.0
    """Two photos agree on a spot where their depths differ by less than both."""
    min_agreeing: int = 2
    """Other photos that must agree for a depth to be kept."""
    max_cost: float = 0.8
    """Matching cost (1 - correlation) from which on a depth has no say."""
    max_points: int = 500_000
    """Most points of the fused cloud."""
    seed: int = 0
    device: str = "cpu"
