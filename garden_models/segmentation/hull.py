"""Carve the space that an object may fill from its masks in all views (Laurentini 1994).

The hull keeps a mask from spreading over what another view shows to be empty, and lets it
cover parts of the object without texture, where stereo found no points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float32
from scipy import ndimage

from garden_models.geometry.camera import project
from garden_models.scene import View

CELLS = 56
"""Voxels along the longest side of the object."""
ALLOWED_MISSES = 0.15
"""Share of the views in which a filled voxel may lie outside of the mask."""
SURELY_OUTSIDE = 0.35
"""Probability of the target under which a pixel carves."""


@dataclass(frozen=True)
class VisualHull:
    """Centres (GV) of the voxels that may be filled, and the voxels' side in metres."""

    centres: Float[np.ndarray, "n 3"]
    cell: float

    def silhouette(
        self,
        K: Float[np.ndarray, "3 3"],
        camera_from_gv: Float[np.ndarray, "4 4"],
        rows: slice,
        columns: slice,
    ) -> Bool[np.ndarray, "h w"]:
        """Return the pixels of a window that see into the hull."""
        out = np.zeros((rows.stop - rows.start, columns.stop - columns.start), bool)
        pixels, z = project(self.centres, K, camera_from_gv)
        if not (z > 0).any():
            return out
        radius = int(np.ceil(0.9 * self.cell * K[0, 0] / np.median(z[z > 0])))
        place = np.floor(np.nan_to_num(pixels, nan=-1e6)) - [columns.start, rows.start]
        inside = ((place >= 0) & (place < [out.shape[1], out.shape[0]])).all(1)
        column, row = place[inside].astype(int).T
        out[row, column] = True
        grown = ndimage.binary_dilation(out, _disc(radius))
        filled: Bool[np.ndarray, "h w"] = ndimage.binary_erosion(
            grown, _disc(max(radius // 2, 1)), border_value=1
        )
        return filled


def carve(
    low: Float[np.ndarray, "3"],
    high: Float[np.ndarray, "3"],
    views: tuple[View, ...],
    cameras: tuple[Float[np.ndarray, "4 4"], ...],
    targets: list[Float32[np.ndarray, "h w"] | None],
    windows: list[tuple[slice, slice] | None],
) -> VisualHull:
    """Return the hull in the box ``low``..``high`` (GV) of the target's probabilities.

    ``targets[i]`` covers ``windows[i]`` of view i; around it nothing is the target. A view
    that shows something nearer in a voxel's pixel says nothing about the voxel.
    """
    cell = float((high - low).max()) / CELLS
    axes = [np.arange(a + cell / 2, b + cell / 2, cell) for a, b in zip(low, high, strict=True)]
    centres = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    misses, looks = np.zeros(len(centres)), np.zeros(len(centres))
    for view, camera, target, window in zip(views, cameras, targets, windows, strict=True):
        if target is None or window is None:
            continue
        whole = np.zeros(view.depth.shape)
        whole[window] = target
        pixels, z = project(centres, view.K, camera)
        place = np.floor(np.nan_to_num(pixels, nan=-1.0)).astype(int)
        seen = ((place >= 0) & (place < np.array(view.size))).all(1) & (z > 0)
        column, row = place[seen].T
        depth = view.depth[row, column]
        clear = (depth <= 0) | (depth > z[seen] - 2 * cell) | (whole[row, column] >= 0.5)
        index = np.flatnonzero(seen)[clear]
        looks[index] += 1
        misses[index] += whole[row[clear], column[clear]] < SURELY_OUTSIDE
    filled = (looks > 0) & (misses <= ALLOWED_MISSES * looks)
    return VisualHull(centres[filled], cell)


def _disc(radius: int) -> Bool[np.ndarray, "d d"]:
    y, x = np.mgrid[-radius : radius + 1, -radius : radius + 1]
    return x * x + y * y <= radius * radius + 1
