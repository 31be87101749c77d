"""Turn filled cells of a grid into simple polygons, and measure polygons."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import ndimage

Polygon = Float[np.ndarray, "k 2"]


@dataclass(frozen=True)
class Grid:
    """Square cells over a plane: cell (row, column) covers
    ``origin + cell * [column, row]`` to ``origin + cell * [column + 1, row + 1]``.
    """

    origin: Float[np.ndarray, "2"]
    cell: float
    shape: tuple[int, int]

    @classmethod
    def around(
        cls, points: Float[np.ndarray, "n 2"], cell: float, margin: int, max_cells: int = 1024
    ) -> Grid:
        """Return a grid over the points with ``margin`` empty cells around them.

        Cells grow where a side would have more than ``max_cells`` of them.
        """
        low, high = points.min(0), points.max(0)
        cell = max(cell, float((high - low).max()) / max_cells)
        columns, rows = (np.floor((high - low) / cell).astype(int) + 1 + 2 * margin).tolist()
        return cls(low - margin * cell, cell, (rows, columns))

    def cells_of(
        self, points: Float[np.ndarray, "n 2"]
    ) -> tuple[Int[np.ndarray, " n"], Int[np.ndarray, " n"], Bool[np.ndarray, " n"]]:
        """Return (row, column, inside) of each point; row and column are clipped."""
        index = np.floor((points - self.origin) / self.cell)
        index = np.nan_to_num(index, nan=-1.0, posinf=-1.0, neginf=-1.0)
        limit = np.array([self.shape[1], self.shape[0]])
        inside = ((index >= 0) & (index < limit)).all(1)
        clipped = np.clip(index, 0, limit - 1).astype(np.int64)
        return clipped[:, 1], clipped[:, 0], inside

    def count(self, points: Float[np.ndarray, "n 2"]) -> Int[np.ndarray, "r c"]:
        """Return how many points fall into each cell."""
        row, column, inside = self.cells_of(points)
        flat = row[inside] * self.shape[1] + column[inside]
        return np.bincount(flat, minlength=self.shape[0] * self.shape[1]).reshape(self.shape)


def outer_polygon(filled: Bool[np.ndarray, "r c"], grid: Grid, simplify: float = 0.5) -> Polygon:
    """Return the outline of the largest connected region of cells, its holes filled.

    The polygon follows the cells' outer edges to within a quarter cell, is simplified to
    within ``simplify`` cells (Douglas-Peucker) and has positive ``signed_area`` in the
    grid's own axes.
    Raises ValueError if no cell is filled.
    """
    if not filled.any():
        raise ValueError("a polygon needs at least one filled cell")
    # Twice the resolution keeps the outline on the cells' edges instead of their centres.
    fine = np.kron(largest_region(filled), np.ones((2, 2), bool)).astype(np.uint8)
    contours, _ = cv2.findContours(np.pad(fine, 1), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    contour = max(contours, key=cv2.contourArea)
    contour = cv2.approxPolyDP(contour, 2 * simplify, True)[:, 0].astype(np.float64)
    if len(contour) < 3:
        rows, columns = np.nonzero(fine)
        x0, x1 = columns.min() + 0.5, columns.max() + 1.5
        y0, y1 = rows.min() + 0.5, rows.max() + 1.5
        contour = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    polygon = grid.origin + (contour - 0.5) / 2 * grid.cell
    return polygon if signed_area(polygon) > 0 else polygon[::-1]


def largest_region(filled: Bool[np.ndarray, "r c"]) -> Bool[np.ndarray, "r c"]:
    """Return the largest 8-connected region of a boolean grid (all False if empty)."""
    labels, count = ndimage.label(filled, np.ones((3, 3)))
    if count == 0:
        return filled.copy()
    sizes = np.bincount(labels.ravel())
    sizes[0] = 0
    return labels == int(sizes.argmax())


def hull_cells(filled: Bool[np.ndarray, "r c"]) -> Bool[np.ndarray, "r c"]:
    """Return the cells inside the convex hull of the filled cells."""
    rows, columns = np.nonzero(filled)
    out = np.zeros(filled.shape, np.uint8)
    if len(rows):
        hull = cv2.convexHull(np.stack([columns, rows], 1).astype(np.int32))
        cv2.fillConvexPoly(out, hull, 1)
    return out.astype(bool) | filled


def signed_area(polygon: Polygon) -> float:
    """Return the shoelace area: positive where the vertices turn from +first to +second axis."""
    x, y = polygon[:, 0], polygon[:, 1]
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def inside_polygon(points: Float[np.ndarray, "n 2"], polygon: Polygon) -> Bool[np.ndarray, " n"]:
    """Tell which points lie inside a simple polygon (even-odd rule)."""
    inside = np.zeros(len(points), bool)
    x, y = points[:, 0], points[:, 1]
    for (x0, y0), (x1, y1) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        crosses = (y0 > y) != (y1 > y)
        with np.errstate(divide="ignore", invalid="ignore"):
            at = x0 + (y - y0) * (x1 - x0) / (y1 - y0)
        inside ^= crosses & (x < at)
    return inside
