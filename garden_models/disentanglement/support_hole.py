"""Fill the hole that a removed object leaves in its support, colour pattern and all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import ndimage

from garden_models.disentanglement.config import FillHole
from garden_models.disentanglement.inpainting import inpaint
from garden_models.disentanglement.photo_colours import PhotoView, look_up
from garden_models.geometry.outline import Grid, hull_cells, inside_polygon
from garden_models.scene import PointCloud, SupportSurface


@dataclass(frozen=True)
class Filling:
    """New points on the support, and which of the background's points they replace."""

    points_gv: PointCloud
    replaced: Bool[np.ndarray, " n"]


def fill_hole(
    background_gv: PointCloud,
    removed_gv: Sequence[PointCloud],
    support: SupportSurface,
    views: tuple[PhotoView, ...],
    config: FillHole = FillHole(),
) -> Filling | None:
    """Return points that close the support where objects stood beside each other.

    The region is each object's outline from above, grown by ``reach``, and what the objects
    hid from the photos, both within the support. Filled are its cells without support points,
    but for those that photos look through. They lie on the plane through the surrounding
    support points, at their spacing. Colours are those of photos that see the place past the
    objects; where none does, the texture is continued. Returns None if there is too little
    support around.
    """
    bounds = [np.percentile(one.xyz[:, [0, 2]], [1, 99], axis=0) for one in removed_gv]
    size = max(float(np.ptp(bound, axis=0).max()) for bound in bounds)
    low = np.min([bound[0] for bound in bounds], axis=0) - config.shadow * size
    high = np.max([bound[1] for bound in bounds], axis=0) + config.shadow * size
    margin = config.margin * size
    xz = background_gv.xyz[:, [0, 2]]
    candidates = np.flatnonzero(((xz >= low - margin) & (xz <= high + margin)).all(axis=1))
    layer = _support_layer(background_gv.subset(candidates), support, config)
    if layer is None:
        return None
    on_support = candidates[layer.members]
    points = background_gv.subset(on_support)
    spacing = float(np.median(points.spacing))
    corners = np.stack([low - margin, high + margin])
    grid = Grid.around(corners, spacing, margin=0, max_cells=config.most_cells)
    closed = _closed(points, grid)
    region = _shadow(~closed, low, high, support, layer, grid, views, config)
    for one in removed_gv:
        region |= _outline(one, support, grid, config.reach * size)
    cells = region & ~closed
    if not cells.any():
        return Filling(points.subset(np.zeros(0, int)), np.zeros(len(background_gv), bool))
    seen = look_up(_cell_centres(cells, layer, grid), grid.cell, views, config.look_up)
    shown = np.full((*grid.shape, 3), np.nan)
    shown[cells] = seen.rgb
    # Single cells are gaps of the sampling, not what an object hid.
    hidden = ndimage.binary_opening(cells & np.isnan(shown[..., 0]), np.ones((2, 2)))
    rim = _grown(hidden, config.contact * size / grid.cell) & ~hidden
    shown[rim] = np.nan
    texture = _texture(points, cells | rim, shown, grid, config)
    if texture is None:
        return None
    cells[cells] = ~seen.empty
    cells |= rim & closed
    row, column, inside = grid.cells_of(points.xyz[:, [0, 2]])
    replaced = np.zeros(len(background_gv), bool)
    replaced[on_support[inside & cells[row, column]]] = True
    replaced[_fringe(background_gv, candidates, layer, cells, grid, config.contact * size)] = True
    return Filling(_cell_points(cells, texture, layer, grid), replaced)


@dataclass(frozen=True)
class _Layer:
    """Support points (indices) and their plane ``y = height + slope @ ((x, z) - centre)``."""

    members: np.ndarray
    height: float
    slope: Float[np.ndarray, "2"]
    centre: Float[np.ndarray, "2"]

    def y(self, xz: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " n"]:
        """Return the plane's y at points (x, z)."""
        return self.height + (xz - self.centre) @ self.slope


def _support_layer(points: PointCloud, support: SupportSurface, config: FillHole) -> _Layer | None:
    """Find the points of the support and the plane through them."""
    xz, y = points.xyz[:, [0, 2]], points.xyz[:, 1]
    band = config.layer_spacings * points.spacing
    wide = np.abs(y - support.height_gv) <= 2 * band
    if wide.sum() < 30:
        return None
    centre, height, slope = xz[wide].mean(axis=0), support.height_gv, np.zeros(2)
    members = wide
    for width in (2.0, 1.5, 1.0):
        off = y - height - (xz - centre) @ slope
        members = np.abs(off) <= width * band
        if members.sum() < 30:
            return None
        design = np.column_stack([xz[members] - centre, np.ones(int(members.sum()))])
        solution, *_ = np.linalg.lstsq(design, y[members], rcond=None)
        slope, height = solution[:2], float(solution[2])
        if np.hypot(*slope) > config.most_slope:
            slope, height = np.zeros(2), float(np.median(y[members]))
    return _Layer(np.flatnonzero(members), height, slope, centre)


def _fringe(
    background_gv: PointCloud,
    candidates: Int[np.ndarray, " n"],
    layer: _Layer,
    cells: Bool[np.ndarray, "r c"],
    grid: Grid,
    height_m: float,
) -> Int[np.ndarray, " m"]:
    """Return points less than ``height_m`` over filled cells: the objects' frayed feet."""
    xyz = background_gv.xyz[candidates]
    row, column, inside = grid.cells_of(xyz[:, [0, 2]])
    height = layer.y(xyz[:, [0, 2]]) - xyz[:, 1]
    low = (height > -height_m) & (height < height_m)
    return candidates[inside & low & cells[row, column]]


def _outline(
    removed_gv: PointCloud, support: SupportSurface, grid: Grid, reach_m: float
) -> Bool[np.ndarray, "r c"]:
    """Return the cells under an object and close around it: its hull from above, grown."""
    from_above = hull_cells(grid.count(_within(removed_gv.xyz[:, [0, 2]])) > 0)
    grown = _grown(from_above, reach_m / grid.cell)
    rows, columns = np.nonzero(grown)
    centres = grid.origin + grid.cell * (np.stack([columns, rows], axis=1) + 0.5)
    on_support = inside_polygon(centres, support.outline_gv)
    # What the object itself stands on is support, whatever the outline says.
    region = from_above.copy()
    region[rows[on_support], columns[on_support]] = True
    return region


def _shadow(
    asked: Bool[np.ndarray, "r c"],
    low: Float[np.ndarray, "2"],
    high: Float[np.ndarray, "2"],
    support: SupportSurface,
    layer: _Layer,
    grid: Grid,
    views: tuple[PhotoView, ...],
    config: FillHole,
) -> Bool[np.ndarray, "r c"]:
    """Return those of the asked cells between ``low`` and ``high`` that objects hid."""
    places = _cell_centres(asked, layer, grid)
    near = ((places[:, [0, 2]] >= low) & (places[:, [0, 2]] <= high)).all(axis=1)
    near &= inside_polygon(places[:, [0, 2]], support.outline_gv)
    hidden = np.zeros(len(places), bool)
    seen = look_up(places[near], grid.cell, views, config.look_up)
    hidden[near] = (seen.blocked >= config.least_blocked) & ~seen.empty
    shadow = np.zeros(grid.shape, bool)
    shadow[asked] = hidden
    return shadow


def _within(xz: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "m 2"]:
    """Drop stray points: those outside of the middle 98 % on an axis."""
    low, high = np.percentile(xz, [1, 99], axis=0)
    return xz[((xz >= low) & (xz <= high)).all(axis=1)]


def _closed(points: PointCloud, grid: Grid) -> Bool[np.ndarray, "r c"]:
    """Return the cells that hold support points, gaps of the sampling closed."""
    occupied = np.pad(grid.count(points.xyz[:, [0, 2]]) > 0, 2, mode="edge")
    return np.asarray(ndimage.binary_closing(occupied, np.ones((3, 3)))[2:-2, 2:-2])


def _grown(cells: Bool[np.ndarray, "r c"], radius: float) -> Bool[np.ndarray, "r c"]:
    """Return the cells within a radius (in cells) of the given ones."""
    if not cells.any():
        return cells
    distance = cv2.distanceTransform((~cells).astype(np.uint8), cv2.DIST_L2, 5)
    return np.asarray(distance <= radius + 0.5)


def _texture(
    points: PointCloud,
    cells: Bool[np.ndarray, "r c"],
    shown: Float[np.ndarray, "r c 3"],
    grid: Grid,
    config: FillHole,
) -> Float[np.ndarray, "r c 3"] | None:
    """Return the support's colours as a picture from above.

    Around ``cells`` they are the points' colours, in them what photos show (NaN where
    nothing), and else continued from both.
    """
    row, column, inside = grid.cells_of(points.xyz[:, [0, 2]])
    flat = (row * grid.shape[1] + column)[inside]
    number = grid.shape[0] * grid.shape[1]
    count = np.bincount(flat, minlength=number)
    rgb = points.rgb[inside].astype(float)
    total = np.stack([np.bincount(flat, rgb[:, c], number) for c in range(3)], axis=1)
    texture = (total / np.maximum(count, 1)[:, None]).reshape(*grid.shape, 3)
    is_shown = cells & np.isfinite(shown[..., 0])
    known = ((count > 0).reshape(grid.shape) & ~cells) | is_shown
    texture[is_shown] = shown[is_shown]
    if known.sum() < 30:
        return None
    return np.asarray(inpaint(texture, known, cells & ~known, config.inpainting), float)


def _cell_centres(
    cells: Bool[np.ndarray, "r c"], layer: _Layer, grid: Grid
) -> Float[np.ndarray, "n 3"]:
    """Return the centres of cells on the support's plane, in row-major order."""
    row, column = np.nonzero(cells)
    xz = grid.origin + grid.cell * (np.stack([column, row], axis=1) + 0.5)
    return np.stack([xz[:, 0], layer.y(xz), xz[:, 1]], axis=1)


def _cell_points(
    cells: Bool[np.ndarray, "r c"],
    texture: Float[np.ndarray, "r c 3"],
    layer: _Layer,
    grid: Grid,
) -> PointCloud:
    """Return one point at the centre of each cell, on the support's plane.

    Their confidence is 0: no depth map holds them.
    """
    xyz = _cell_centres(cells, layer, grid)
    up = np.array([layer.slope[0], -1.0, layer.slope[1]])
    return PointCloud(
        xyz,
        np.clip(np.rint(texture[cells]), 0, 255).astype(np.uint8),
        np.tile(up / np.linalg.norm(up), (len(xyz), 1)),
        np.full(len(xyz), grid.cell),
        np.zeros(len(xyz)),
    )
