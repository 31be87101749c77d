"""Normals of the surfaces in a depth map, at a coarse grid of pixels."""

from __future__ import annotations

import warnings

import numpy as np
from jaxtyping import Float

from garden_models.geometry.camera import backproject_depth, camera_centre, resize_intrinsics

JUMP = 0.06
"""Relative difference of depth to a neighbour from which it is another surface."""


def coarse_depth(depth: Float[np.ndarray, "h w"], long_side: int) -> Float[np.ndarray, "a b"]:
    """Return the median depth of square blocks, 0 where under half of a block has any.

    The blocks are so large that the longer side has at most ``long_side`` of them; what does
    not fill a block at the right and bottom is left out.
    """
    block = max(1, -(-max(depth.shape) // long_side))
    rows, columns = depth.shape[0] // block, depth.shape[1] // block
    cut = depth[: rows * block, : columns * block].astype(np.float64)
    cells = (
        cut.reshape(rows, block, columns, block).transpose(0, 2, 1, 3).reshape(rows, columns, -1)
    )
    cells = np.where(cells > 0, cells, np.nan)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        median = np.nanmedian(cells, axis=-1)
    return np.where(np.isfinite(cells).mean(axis=-1) >= 0.5, median, 0.0)


def depth_normals(
    depth: Float[np.ndarray, "h w"],
    K: Float[np.ndarray, "3 3"],
    camera_from_world: Float[np.ndarray, "r 4"],
    long_side: int,
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]]:
    """Return points and unit normals towards the camera, in the world.

    Only cells whose four neighbours lie on the same surface (by ``JUMP``) have a normal.
    """
    coarse = coarse_depth(depth, long_side)
    rows, columns = coarse.shape
    if min(rows, columns) < 3:
        return np.zeros((0, 3)), np.zeros((0, 3))
    block = max(1, -(-max(depth.shape) // long_side))
    cut = (columns * block, rows * block)
    points = backproject_depth(
        coarse, resize_intrinsics(K, cut, (columns, rows)), camera_from_world
    )
    middle = coarse[1:-1, 1:-1]
    sides = (coarse[1:-1, :-2], coarse[1:-1, 2:], coarse[:-2, 1:-1], coarse[2:, 1:-1])
    whole = middle > 0
    for side in sides:
        whole &= (side > 0) & (np.abs(side - middle) < JUMP * middle)
    across = points[1:-1, 2:] - points[1:-1, :-2]
    down = points[2:, 1:-1] - points[:-2, 1:-1]
    normal = np.cross(across, down)[whole]
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    at = points[1:-1, 1:-1][whole]
    proper = length[:, 0] > 0
    normal, at = normal[proper] / length[proper], at[proper]
    away = np.einsum("ni,ni->n", normal, at - camera_centre(camera_from_world)) > 0
    normal[away] *= -1
    return at, normal
