"""What the test models are asked and answer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class Question:
    """``how`` has a test model misbehave."""

    SCHEMA: ClassVar[str] = "test.Question/1"
    values: Float[np.ndarray, "n 2"]
    how: str = ""
    seed: int = 0


@dataclass(frozen=True)
class Part:
    pose: Float[np.ndarray, "4 4"]
    note: str = ""


@dataclass(frozen=True)
class Answer:
    SCHEMA: ClassVar[str] = "test.Answer/1"
    values: Float[np.ndarray, "n 2"]
    noise: float
    parts: tuple[Part, ...] = ()
    extra: Float[np.ndarray, " n"] | None = None


Ask = Callable[[Question], Answer]
