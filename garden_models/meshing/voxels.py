"""Define the regular voxel grid, parallel to Gravity-View, in which an object is fused."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int


@dataclass(frozen=True)
class VoxelGrid:
    """Cubic voxels; ``origin_gv`` is the centre of voxel (0, 0, 0), ``spacing`` in metres."""

    origin_gv: Float[np.ndarray, "3"]
    spacing: float
    shape: tuple[int, int, int]

    @classmethod
    def around(
        cls, low_gv: Float[np.ndarray, "3"], high_gv: Float[np.ndarray, "3"], spacing: float
    ) -> VoxelGrid:
        """Return the smallest grid whose voxel centres reach from ``low`` to ``high``."""
        count = np.maximum(np.ceil((high_gv - low_gv) / spacing).astype(int) + 1, 2)
        shape = (int(count[0]), int(count[1]), int(count[2]))
        return cls(np.asarray(low_gv, float), float(spacing), shape)

    @property
    def high_gv(self) -> Float[np.ndarray, "3"]:
        """Centre of the last voxel."""
        return self.origin_gv + self.spacing * (np.array(self.shape) - 1)

    def centres(self, flat: Int[np.ndarray, " n"]) -> Float[np.ndarray, "n 3"]:
        """Return the centres (GV, float32) of voxels given by flat index."""
        index = np.stack(np.unravel_index(flat, self.shape), axis=1)
        return (self.origin_gv + self.spacing * index).astype(np.float32)

    def nearest(
        self, points_gv: Float[np.ndarray, "n 3"]
    ) -> tuple[Int[np.ndarray, " n"], Bool[np.ndarray, " n"]]:
        """Return flat indices of the nearest voxels and which points lie in the grid.

        Indices of points outside are clamped to its border.
        """
        index = np.rint((points_gv - self.origin_gv) / self.spacing).astype(np.int64)
        limit = np.array(self.shape)
        inside = ((index >= 0) & (index < limit)).all(axis=1)
        index = np.clip(index, 0, limit - 1)
        return np.ravel_multi_index(tuple(index.T), self.shape), inside
