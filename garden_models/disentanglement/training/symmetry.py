"""Turn described pairs by quarters about gravity and mirror them: eight pairs for one."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from garden_models.disentanglement.network.describe import OWN

_VECTORS = (0, 6, 9, 15, OWN + 15)
"""Columns at which three components of a place or direction begin (``describe``)."""
_EXTENT = OWN + 18
_CONDITION_VECTORS = (0, 3)


def symmetry(
    features: Float[np.ndarray, "n f"], condition: Float[np.ndarray, "k g"], number: int
) -> tuple[Float[np.ndarray, "n f"], Float[np.ndarray, "k g"]]:
    """Return copies under one of the eight symmetries of the square (0: unchanged)."""
    swap, flip_x, flip_z = number & 1, number & 2, number & 4
    features, condition = features.copy(), condition.copy()
    for array, starts in ((features, _VECTORS), (condition, _CONDITION_VECTORS)):
        for start in starts:
            x, z = array[:, start].copy(), array[:, start + 2].copy()
            x, z = (-x if flip_x else x), (-z if flip_z else z)
            array[:, start], array[:, start + 2] = (z, x) if swap else (x, z)
    if swap:
        features[:, [_EXTENT, _EXTENT + 2]] = features[:, [_EXTENT + 2, _EXTENT]]
    return features, condition
