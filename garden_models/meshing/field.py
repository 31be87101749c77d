"""Turn evidence into one signed field: positive outside, zero on the object's surface.

The field minimises ``sum w (f - d)^2 + stiffness sum |grad f|^2`` (a screened Poisson
problem, Kazhdan and Hoppe 2013) by Jacobi steps: where evidence is strong it rules, where
there is none the surface bridges the gap smoothly.
"""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Bool, Float
from scipy import ndimage

STEPS = 40
"""Jacobi steps: evidence reaches about the square root of twice as many voxels."""

STIFFNESS = 0.08
"""Weight of smoothness against one full unit of evidence."""

UNKNOWN_WEIGHT = 0.03
"""Weight of the assumption that what nobody saw inside the hull is solid."""


def solve_field(
    target: Float[np.ndarray, "x y z"],
    weight: Float[np.ndarray, "x y z"],
    stiffness: float = STIFFNESS,
    steps: int = STEPS,
) -> Float[np.ndarray, "x y z"]:
    """Return the smooth field near ``target`` where ``weight`` (0..1) is large."""
    data = torch.from_numpy(np.ascontiguousarray(target, np.float32))
    trust = torch.from_numpy(np.ascontiguousarray(weight, np.float32))
    diagonal = trust + 6.0 * stiffness
    pull = trust * data
    field = data.clone()
    for _ in range(steps):
        padded = torch.nn.functional.pad(field[None, None], (1,) * 6, mode="replicate")[0, 0]
        neighbours = torch.zeros_like(field)
        for axis in range(3):
            for start in (0, 2):
                inner = [slice(1, -1)] * 3
                inner[axis] = slice(start, start + field.shape[axis])
                neighbours += padded[tuple(inner)]
        field = (pull + stiffness * neighbours) / diagonal
    return field.numpy()


def keep_solid(
    field: Float[np.ndarray, "x y z"], least_share: float
) -> tuple[Float[np.ndarray, "x y z"], int]:
    """Keep the pieces of at least ``least_share`` of the largest, and fill cavities.

    Returns the field and the number of pieces kept.
    """
    field = field.copy()
    pieces, count = ndimage.label(field < 0)
    if count == 0:
        return field, 0
    sizes = np.bincount(pieces.ravel())
    sizes[0] = 0
    kept = sizes >= least_share * sizes.max()
    kept[0] = False
    drop = (field < 0) & ~kept[pieces]
    field[drop] = np.abs(field[drop]) + 1e-3
    field[_cavities(field)] *= -1.0
    return field, int(kept.sum())


def _cavities(field: Float[np.ndarray, "x y z"]) -> Bool[np.ndarray, "x y z"]:
    """Return outside voxels that the grid's border cannot be reached from."""
    empty, _ = ndimage.label(field >= 0)
    border = np.ones(field.shape, bool)
    border[1:-1, 1:-1, 1:-1] = False
    reached = np.zeros(int(empty.max()) + 1, bool)
    reached[empty[border]] = True
    reached[0] = True
    return ~reached[empty]
