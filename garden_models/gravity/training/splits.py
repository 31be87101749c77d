"""Keep training, validation and test scenes apart by their seeds."""

from __future__ import annotations

from typing import Literal

import numpy as np

Split = Literal["train", "validation", "test"]
SPLITS: tuple[Split, ...] = ("train", "validation", "test")


def scene_generator(split: Split, number: int) -> np.random.Generator:
    """Return the generator that makes a split's scene; no two splits share one."""
    return np.random.default_rng((SPLITS.index(split), number))
