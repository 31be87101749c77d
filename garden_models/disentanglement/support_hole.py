"""Fill the hole that a removed object leaves in its support, colour pattern and all."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage

from garden_models.disentanglement.inpainting import Inpainting, inpaint
from garden_models.disentanglement.photo_colours import LookUp, PhotoView, look_up
from garden_models.geometry.outline import Grid, hull_cells, inside_polygon
from garden_models.scene import PointCloud, SupportSurface


@dataclass(frozen=True)
class FillHole:
    """Lengths are relative to the points' spacing or the removed object's size."""

    reach: float = 0.12
    """How far around the object the support may lack points because of it (its shadow and
    what it hid from low cameras)."""
    margin: float = 0.5
    """How far around that its texture is looked at."""
    layer_spacings: float = 2.5
    """Points this near to the support's plane are support."""
    most_slope: float = 0.06
    """Steepest lean of a support, as in its detection: three and a half degrees."""
    mixed_cells: int = 2
    """Cells at the hole's rim whose colours mix with the object's: they are filled anew."""
    most_cells: int = 220
    """Cells of the texture's longer side; cells grow beyond the spacing to keep to it."""
    look_up: LookUp = field(default_factory=LookUp)
    inpainting: Inpainting = field(default_factory=Inpainting)


@dataclass(frozen=True)
class Filling:
    """New points on the support, and which of the background's points they replace."""

    points_gv: PointCloud
    replaced: Bool[np.ndarray, " n"]


def fill_hole(
    background_gv: PointCloud,
    removed_gv: PointCloud,
    support: SupportSurface,
    views: tuple[PhotoView, ...],
    config: FillHole = FillHole(),
) -> Filling | None:
    """Return points that close the support where the object was.

    The region is the object's outline from above, grown by ``reach``, within the support;
    filled are its cells without support points, but for those that photos look through. They
    lie on the plane through the surrounding support points, at their spacing. Colours are
    those of photos that see the place past the object; where none does, the texture is
    continued. Returns None if there is too little support around.
    """
    low, high = np.percentile(removed_gv.xyz, [1, 99], axis=0)
    size = float((high - low).max())
    around = np.array([config.reach + config.margin] * 2) * size
    near = (
        (background_gv.xyz[:, [0, 2]] >= low[[0, 2]] - around)
        & (background_gv.xyz[:, [0, 2]] <= high[[0, 2]] + around)
    ).all(axis=1)
    candidates = np.flatnonzero(near)
    layer = _support_layer(background_gv.subset(candidates), support, config)
    if layer is None:
        return None
    on_support = candidates[layer.members]
    points = background_gv.subset(on_support)
    spacing = float(np.median(points.spacing))
    corners = np.stack([low[[0, 2]] - around, high[[0, 2]] + around])
    cell = max(spacing, float(np.ptp(corners, axis=0).max()) / config.most_cells)
    grid = Grid.around(corners, cell, margin=0, max_cells=config.most_cells)
    region = _region(removed_gv, support, grid, config.reach * size)
    hole, rim = _hole(points, region, grid, config)
    if not hole.any():
        return Filling(points.subset(np.zeros(0, int)), np.zeros(len(background_gv), bool))
    cells = hole | rim
    seen = look_up(_cell_centres(cells, layer, grid), cell, views, config.look_up)
    texture = _texture(points, cells, seen.rgb, grid, config)
    if texture is None:
        return None
    cells[cells] = ~seen.empty
    row, column, inside = grid.cells_of(points.xyz[:, [0, 2]])
    replaced = np.zeros(len(background_gv), bool)
    replaced[on_support[inside & (rim & cells)[row, column]]] = True
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


def _region(
    removed_gv: PointCloud, support: SupportSurface, grid: Grid, reach_m: float
) -> Bool[np.ndarray, "r c"]:
    """Return the cells that the object may have hidden: its hull from above, grown."""
    from_above = hull_cells(grid.count(_within(removed_gv.xyz[:, [0, 2]])) > 0)
    grown = _grown(from_above, reach_m / grid.cell)
    rows, columns = np.nonzero(grown)
    centres = grid.origin + grid.cell * (np.stack([columns, rows], axis=1) + 0.5)
    on_support = inside_polygon(centres, support.outline_gv)
    # What the object itself stands on is support, whatever the outline says.
    region = from_above.copy()
    region[rows[on_support], columns[on_support]] = True
    return region


def _within(xz: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "m 2"]:
    """Drop stray points: those outside of the middle 98 % on an axis."""
    low, high = np.percentile(xz, [1, 99], axis=0)
    return xz[((xz >= low) & (xz <= high)).all(axis=1)]


def _hole(
    points: PointCloud, region: Bool[np.ndarray, "r c"], grid: Grid, config: FillHole
) -> tuple[Bool[np.ndarray, "r c"], Bool[np.ndarray, "r c"]]:
    """Return the cells without support points, and the rim of the holes among them."""
    occupied = grid.count(points.xyz[:, [0, 2]]) > 0
    padded = np.pad(occupied, 2, mode="edge")
    closed = ndimage.binary_closing(padded, np.ones((3, 3)))[2:-2, 2:-2]
    hole = region & ~closed
    # Single cells are gaps of the sampling, not holes that an object left.
    core = ndimage.binary_opening(hole, np.ones((2, 2)))
    rim = _grown(core, float(config.mixed_cells)) & occupied & ~hole
    return hole, rim


def _grown(cells: Bool[np.ndarray, "r c"], radius: float) -> Bool[np.ndarray, "r c"]:
    """Return the cells within a radius (in cells) of the given ones."""
    if not cells.any():
        return cells
    distance = cv2.distanceTransform((~cells).astype(np.uint8), cv2.DIST_L2, 5)
    return np.asarray(distance <= radius + 0.5)


def _texture(
    points: PointCloud,
    cells: Bool[np.ndarray, "r c"],
    seen_rgb: Float[np.ndarray, "n 3"],
    grid: Grid,
    config: FillHole,
) -> Float[np.ndarray, "r c 3"] | None:
    """Return the support's colours as a picture from above.

    Around ``cells`` they are the points' colours, in them what photos show
    (``seen_rgb``, NaN where nothing), and else continued from both.
    """
    row, column, inside = grid.cells_of(points.xyz[:, [0, 2]])
    flat = (row * grid.shape[1] + column)[inside]
    number = grid.shape[0] * grid.shape[1]
    count = np.bincount(flat, minlength=number)
    rgb = points.rgb[inside].astype(float)
    total = np.stack([np.bincount(flat, rgb[:, c], number) for c in range(3)], axis=1)
    texture = (total / np.maximum(count, 1)[:, None]).reshape(*grid.shape, 3)
    known = (count > 0).reshape(grid.shape) & ~cells
    shown = np.isfinite(seen_rgb[:, 0])
    texture[cells] = np.where(shown[:, None], np.nan_to_num(seen_rgb), texture[cells])
    known[cells] = shown
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
