"""Bake vertex colours into a picture and per-corner texture coordinates.

Every two triangles share a square cell of texels, one in the upper left half, one in the
lower right. Inside its half a triangle's colours are the linear blend of its three corners,
continued beyond its edges, so that bilinear sampling gives back the blend that vertex colours
would have given. Coordinates are those of Wavefront OBJ: u right, v up, the origin in the
picture's lower left corner; the picture's first row is its top.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, UInt8

MAX_SIZE = 2048
"""Texels along a side at most: larger textures cost a viewer more than they show."""
MIN_SIZE = 16
"""Texels along a side at least."""


@dataclass(frozen=True)
class _Cell:
    """A square of ``side`` texels; a triangle's legs span ``leg`` texels, ``margin`` inside."""

    side: int
    leg: int
    margin: int

    @property
    def max_faces(self) -> int:
        """How many faces fit in the largest texture."""
        return 2 * (MAX_SIZE // self.side) ** 2


# Sides are powers of two, so that the coarser levels of a mipmap keep to cells as long as they
# can. The margin keeps what a renderer samples just outside a triangle (multisampling does)
# away from its neighbours; in small cells only the bilinear footprint is kept apart.
_ROOMY = _Cell(side=8, leg=3, margin=1)
_TIGHT = _Cell(side=4, leg=1, margin=0)

MAX_FACES = _TIGHT.max_faces
"""More faces have no room in the largest texture."""


@dataclass(frozen=True)
class TextureAtlas:
    """A square picture and where in it each face's corners lie (u right, v up, 0..1)."""

    rgb: UInt8[np.ndarray, "s s 3"]
    corner_uv: Float[np.ndarray, "f 3 2"]


def bake_vertex_colours(
    faces: Int[np.ndarray, "f 3"], vertex_rgb: UInt8[np.ndarray, "v 3"]
) -> TextureAtlas:
    """Return a texture that shows ``vertex_rgb`` blended linearly over each face.

    The texture's side is the least power of two that holds all faces, 16 to 2048 texels.
    Raises ValueError if there is no face, or more than MAX_FACES.
    """
    if not 0 < len(faces) <= MAX_FACES:
        raise ValueError(f"a texture holds 1 to {MAX_FACES} faces, got {len(faces)}")
    cell = _ROOMY if len(faces) <= _ROOMY.max_faces else _TIGHT
    corner_rgb = vertex_rgb[faces].astype(np.float32)  # (f, 3 corners, 3)
    order = _by_colour(corner_rgb.mean(axis=1))
    column, row = _along_z_curve(np.arange((len(faces) + 1) // 2))
    per_side = max(MIN_SIZE // cell.side, _power_of_two(int(max(column.max(), row.max())) + 1))
    return TextureAtlas(
        _picture(corner_rgb[order], column, row, per_side, cell),
        _corner_uv(order, column, row, per_side, cell),
    )


def _picture(
    corner_rgb: Float[np.ndarray, "f 3 3"],
    column: Int[np.ndarray, " c"],
    row: Int[np.ndarray, " c"],
    per_side: int,
    cell: _Cell,
) -> UInt8[np.ndarray, "s s 3"]:
    """Draw the triangles, two a cell, in the order of the cells; the rest in their mean."""
    side = cell.side
    if len(corner_rgb) % 2:  # An odd face out fills its cell alone.
        corner_rgb = np.concatenate([corner_rgb, corner_rgb[-1:]])
    y, x = np.mgrid[:side, :side]
    right, down = (x - cell.margin) / cell.leg, (y - cell.margin) / cell.leg
    weights = np.stack([1 - right - down, right, down], axis=2).astype(np.float32)
    upper_left = np.einsum("yxk,fkc->fyxc", weights, corner_rgb[0::2])
    lower_right = np.einsum("yxk,fkc->fyxc", weights[::-1, ::-1], corner_rgb[1::2])
    drawn = np.where((x + y < side)[..., None], upper_left, lower_right)
    cells = np.empty((per_side, per_side, side, side, 3), np.uint8)
    cells[:] = np.rint(corner_rgb.mean(axis=(0, 1)))
    cells[row, column] = np.clip(np.rint(drawn), 0, 255)
    return cells.transpose(0, 2, 1, 3, 4).reshape(per_side * side, per_side * side, 3)


def _corner_uv(
    order: Int[np.ndarray, " f"],
    column: Int[np.ndarray, " c"],
    row: Int[np.ndarray, " c"],
    per_side: int,
    cell: _Cell,
) -> Float[np.ndarray, "f 3 2"]:
    """Return where the corners of every face lie, all of them at centres of texels."""
    near, far = cell.margin, cell.margin + cell.leg
    upper_left = np.array([[near, near], [far, near], [near, far]])
    halves = np.stack([upper_left, cell.side - 1 - upper_left])  # (2, 3 corners, xy)
    corner = np.stack([column, row], axis=1)[:, None, None] * cell.side
    texel = (corner + halves).reshape(-1, 3, 2)[: len(order)]
    placed = (texel + 0.5) / (per_side * cell.side)
    placed[..., 1] = 1.0 - placed[..., 1]
    uv = np.empty_like(placed)
    uv[order] = placed
    return uv


def _by_colour(rgb: Float[np.ndarray, "f 3"]) -> Int[np.ndarray, " f"]:
    """Return an order in which like colours follow each other.

    The coarser levels of a mipmap mix neighbouring cells: like with like is not seen.
    """
    levels = rgb.astype(np.int64)
    key = np.zeros(len(rgb), np.int64)
    for bit in range(8):
        for channel in range(3):
            key |= (levels[:, channel] >> bit & 1) << (3 * bit + channel)
    return np.argsort(key, kind="stable")


def _along_z_curve(
    index: Int[np.ndarray, " c"],
) -> tuple[Int[np.ndarray, " c"], Int[np.ndarray, " c"]]:
    """Return column and row along Morton's curve: near on the curve is near in the picture."""
    column, row = np.zeros_like(index), np.zeros_like(index)
    for bit in range(int(index.max()).bit_length() // 2 + 1):
        column |= (index >> (2 * bit) & 1) << bit
        row |= (index >> (2 * bit + 1) & 1) << bit
    return column, row


def _power_of_two(least: int) -> int:
    """Return the smallest power of two that is not below ``least``."""
    return 1 << (least - 1).bit_length()
