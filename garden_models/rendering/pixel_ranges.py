"""List the pixels of many row or column intervals at once."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int


def expand_ranges(
    first: Int[np.ndarray, " m"], last: Int[np.ndarray, " m"]
) -> tuple[Int[np.ndarray, " n"], Int[np.ndarray, " n"]]:
    """List every integer of each range ``first..last`` (ends included; may be empty).

    Return, for each integer, the index of its range and the integer itself.
    """
    count = np.maximum(last - first + 1, 0)
    owner = np.repeat(np.arange(len(first)), count)
    offset = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    return owner, first[owner] + offset
