"""Define a training that can be taken up again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class TrainingState:
    """A training after ``step`` steps: weights and moments as safetensors, losses so far."""

    SCHEMA: ClassVar[str] = "garden.TrainingState/1"
    step: int
    tensors: bytes
    losses: Float[np.ndarray, " s"]
