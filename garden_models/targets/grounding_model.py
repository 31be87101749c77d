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

    def fits(self, request: GroundingRequest) -> str:
        """Return what is wrong with it as an answer to a request, empty if nothing is."""
        if ((self.label < 0) | (self.label >= len(request.labels))).any():
            return f"a label is none of the {len(request.labels)} that were asked for"
        if ((self.scores < 0) | (self.scores > 1)).any():
            return "a score is not between 0 and 1"
        if (self.boxes[:, :2] > self.boxes[:, 2:]).any():
            return "a box ends before it begins"
        return ""


GroundLabels = Callable[[GroundingRequest], GroundingAnswer]
