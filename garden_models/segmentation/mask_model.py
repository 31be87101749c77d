"""What a model that turns boxes into masks is asked and answers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Float, UInt8


@dataclass(frozen=True)
class MaskRequest:
    """One photo and boxes ``(x0, y0, x1, y1)`` in its pixels, one an object."""

    SCHEMA: ClassVar[str] = "garden.MaskRequest/1"
    rgb: UInt8[np.ndarray, "h w 3"]
    boxes: Float[np.ndarray, "k 4"]


@dataclass(frozen=True)
class MaskAnswer:
    """One mask a box, of the photo's size, and the model's own score (0..1) for it."""

    SCHEMA: ClassVar[str] = "garden.MaskAnswer/1"
    masks: Bool[np.ndarray, "k h w"]
    scores: Float[np.ndarray, " k"]


MaskBoxes = Callable[[MaskRequest], MaskAnswer]
