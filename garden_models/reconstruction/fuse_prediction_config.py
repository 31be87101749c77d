"""Configure how predicted depth is checked and fused."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class FusePrediction:
    """``partners`` photos are compared with each photo; a depth is kept where ``min_agreeing``
    of them (or all, if there are fewer) find the same, by less than ``max_relative`` of it and
    ``max_disagreement_px`` of parallax. Where less than ``min_confirmed`` of what the model
    was sure of is kept, the result is degraded.
    """

    partners: int = 8
    min_agreeing: int = 2
    max_relative: float = 0.03
    max_disagreement_px: float = 3.0
    min_confidence: float = 0.1
    min_confirmed: float = 0.3
    max_points: int = 500_000
    device: str = "cpu"
