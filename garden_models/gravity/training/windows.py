"""Cut posed sequences into scenes of a few photos each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int


@dataclass(frozen=True)
class Windows:
    """How many photos make a scene, how far apart they are taken, how many scenes a sequence
    gives at most.
    """

    fewest: int = 2
    most: int = 16
    longest_stride: int = 10
    scenes: int = 20


def windows_of(photos: int, config: Windows, seed: int) -> list[Int[np.ndarray, " n"]]:
    """Return the photos of each scene of a sequence, in order; the seed decides which."""
    rng = np.random.default_rng((seed, photos))
    found: list[np.ndarray] = []
    for _ in range(config.scenes if photos >= config.fewest else 0):
        count = min(int(rng.integers(config.fewest, config.most + 1)), photos)
        stride = int(rng.integers(1, max(1, min(config.longest_stride, photos // count)) + 1))
        first = int(rng.integers(photos - (count - 1) * stride))
        found.append(first + stride * np.arange(count))
    return found
