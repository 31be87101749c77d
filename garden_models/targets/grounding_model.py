"""What a model that finds named things in a photo is asked and answers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float, Int, UInt8


@dataclass(frozen=True)
class GroundingRequest:
    """One photo, the names of what to look for, and the score (0..1) that counts as found."""

    SCHEMA: ClassVar[str] = "garden.GroundingRequest/1"
    rgb: UInt8[np.ndarray, "h w 3"]
    labels: tuple[str, ...]
    min_score: float


@dataclass(frozen=True)
class GroundingAnswer:
    """Boxes ``(x0, y0, x1, y1)`` in the photo's pixels, the best first.

    ``label`` is each one's index into the request's labels; the score is in 0..1. Boxes may
    overlap.
    """

    SCHEMA: ClassVar[str] = "garden.GroundingAnswer/1"
    boxes: Float[np.ndarray, "k 4"]
    scores: Float[np.ndarray, " k"]
    label: Int[np.ndarray, " k"]


GroundLabels = Callable[[GroundingRequest], GroundingAnswer]
