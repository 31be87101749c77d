"""Find the horizontal surfaces that can carry things (paper, section 3.4).

The paper takes the Top-K coordinate peaks along gravity. Here the peaks are those of the
area that faces up; each peak is split into its connected regions, and each region gets an
outline that includes what stands on it hides.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage
from scipy.spatial import cKDTree

from garden_models.geometry.outline import Grid, hull_cells, outer_polygon, signed_area
from garden_models.geometry.peaks import density_peaks
from garden_models.physics.config import FindSupports
from garden_models.physics.hidden_area import HiddenArea
from garden_models.scene import PointCloud, SupportSurface

Points = Float[np.ndarray, "n 3"]


@dataclass(frozen=True)
class SurfacePlane:
    """The plane ``y = height + slope @ (x, z)``, slope small, in GV."""

    height: float
    slope: Float[np.ndarray, "2"]

    def residual(self, points_gv: Points) -> Float[np.ndarray, " n"]:
        """Return how far points lie below the plane along gravity (negative: above)."""
        return points_gv[:, 1] - self.height - points_gv[:, [0, 2]] @ self.slope


def find_support_surfaces(
    points_gv: PointCloud,
    camera_centres_gv: Float[np.ndarray, "c 3"],
    config: FindSupports = FindSupports(),
    is_floor_allowed: bool = True,
) -> tuple[SupportSurface, ...]:
    """Return the floor, tables, shelves and seats, the largest first.

    ``camera_centres_gv`` are where the photos were taken: a surface above all of them
    (a ceiling) cannot have been seen from above, and rays through a gap of a surface tell
    a hole (something behind it was seen) from an area that an object hides. ``floor`` is
    the lowest large surface that has nothing below it. Returns () where nothing faces up.
    """
    points_gv = _thinned(points_gv, config.max_points)
    faces_up = np.abs(points_gv.normal[:, 1]) >= np.cos(np.radians(config.max_slope_deg))
    faces_up &= points_gv.xyz[:, 1] > camera_centres_gv[:, 1].min()
    upward = points_gv.subset(faces_up)
    if len(upward) < 10:
        return ()
    noise = height_noise(upward)
    spacing = float(np.median(upward.spacing))
    band = max(config.band_sigma * noise, spacing)
    hidden = HiddenArea.seen_from(points_gv.xyz, camera_centres_gv)
    min_area = config.min_area_share * float((upward.spacing**2).sum())

    found: list[SupportSurface] = []
    remaining = np.ones(len(upward), bool)
    for _ in range(config.max_peaks):
        plane = _strongest_plane(upward, remaining, band, min_area, config)
        if plane is None:
            break
        off = np.abs(plane.residual(upward.xyz))
        inliers = remaining & (off <= band)
        regions, grid = _regions(upward.xyz[inliers], spacing, config)
        regions = [r for r in regions if r.sum() * grid.cell**2 > 0.5 * min_area]
        covered = hidden.hidden_cells(grid, plane.residual, band)
        taken = np.zeros(len(upward), bool)
        for region in regions:
            cells = _with_hidden(region, covered)
            surface = _surface(plane, upward, inliers, region, cells, grid)
            if surface.area_m2 >= min_area:
                found.append(surface)
                row, column, inside = grid.cells_of(upward.xyz[:, [0, 2]])
                # What noise left just outside of the band is no surface of its own.
                taken |= inside & region[row, column] & (off <= 2 * band)
        remaining &= ~(taken | inliers)
    return _named(found, points_gv, band, config, is_floor_allowed)


def height_noise(upward: PointCloud, neighbours: int = 16) -> float:
    """Return the noise (1 sigma, metres) of up-facing points along gravity.

    It is the typical spread of a point's height about the plane through its neighbours.
    """
    neighbours = min(neighbours, len(upward) - 1)
    if neighbours < 4:
        return 0.0
    sample = np.linspace(0, len(upward) - 1, min(len(upward), 4000)).astype(int)
    _, index = cKDTree(upward.xyz).query(upward.xyz[sample], neighbours + 1)
    near = upward.xyz[index] - upward.xyz[index].mean(1, keepdims=True)
    # Least squares of y on (x, z) in each neighbourhood, ridged for neighbours in a line.
    xz, y = near[:, :, [0, 2]], near[:, :, 1]
    gram = np.einsum("nki,nkj->nij", xz, xz) + 1e-12 * np.eye(2)
    slope = np.linalg.solve(gram, np.einsum("nki,nk->ni", xz, y)[..., None])[..., 0]
    residual = y - np.einsum("nki,ni->nk", xz, slope)
    spread = np.sqrt((residual**2).sum(1) / (neighbours + 1 - 3))
    return float(np.median(spread))


def _strongest_plane(
    upward: PointCloud,
    remaining: Bool[np.ndarray, " n"],
    band: float,
    min_area: float,
    config: FindSupports,
) -> SurfacePlane | None:
    """Return the plane at the highest peak of up-facing area, leaning as its points do."""
    xyz, area = upward.xyz[remaining], upward.spacing[remaining] ** 2
    peaks = density_peaks(xyz[:, 1], area, band / 2) if len(xyz) else ()
    if not peaks or peaks[0].share * area.sum() < min_area:
        return None
    plane = SurfacePlane(peaks[0].position, np.zeros(2))
    limit = np.tan(np.radians(config.max_tilt_deg))
    # A leaning surface crosses the level band in a strip; each fit lets the strip grow.
    for width in (2.0,) * 8 + (1.5, 1.0, 1.0):
        near = np.abs(plane.residual(xyz)) <= width * band
        if near.sum() < 10:
            break
        plane = fit_plane(xyz[near], area[near], limit)
    return plane


def fit_plane(
    points_gv: Points, weights: Float[np.ndarray, " n"], max_slope: float
) -> SurfacePlane:
    """Fit ``y = height + slope @ (x, z)`` by weighted least squares.

    A slope steeper than ``max_slope`` (rise over run) is given up for a level plane
    through the weighted median height.
    """
    xz, y = points_gv[:, [0, 2]], points_gv[:, 1]
    centre = np.average(np.column_stack([xz, y]), axis=0, weights=weights)
    flat, rise = xz - centre[:2], y - centre[2]
    gram = (flat * weights[:, None]).T @ flat
    ridge = 1e-9 * np.trace(gram) * np.eye(2) + 1e-300 * np.eye(2)
    slope = np.linalg.solve(gram + ridge, (flat * weights[:, None]).T @ rise)
    if not np.hypot(*slope) <= max_slope:
        order = np.argsort(y)
        middle = np.searchsorted(np.cumsum(weights[order]), weights.sum() / 2)
        return SurfacePlane(float(y[order][min(middle, len(y) - 1)]), np.zeros(2))
    return SurfacePlane(float(centre[2] - slope @ centre[:2]), slope)


def _regions(
    inliers: Points, spacing: float, config: FindSupports
) -> tuple[list[Bool[np.ndarray, "r c"]], Grid]:
    """Split a surface's points into regions of cells that touch, small gaps closed."""
    grid = Grid.around(inliers[:, [0, 2]], config.cell_spacings * spacing, margin=3)
    filled = ndimage.binary_closing(grid.count(inliers[:, [0, 2]]) > 0, np.ones((3, 3)), 2)
    labels, count = ndimage.label(filled, np.ones((3, 3)))
    return [labels == label for label in range(1, count + 1) if (labels == label).sum() > 3], grid


def _with_hidden(
    region: Bool[np.ndarray, "r c"], hidden: Bool[np.ndarray, "r c"]
) -> Bool[np.ndarray, "r c"]:
    """Add to a region its holes, and the cells in its hull that things above it hide."""
    gap = hull_cells(region) & hidden
    whole = region | ndimage.binary_closing(region | gap, np.ones((3, 3)), 1)
    filled: Bool[np.ndarray, "r c"] = ndimage.binary_fill_holes(whole)
    return filled


def _surface(
    plane: SurfacePlane,
    upward: PointCloud,
    inliers: Bool[np.ndarray, " n"],
    region: Bool[np.ndarray, "r c"],
    cells: Bool[np.ndarray, "r c"],
    grid: Grid,
) -> SupportSurface:
    """Make one region a level surface at its own points' median height."""
    row, column, inside = grid.cells_of(upward.xyz[:, [0, 2]])
    own = inliers & inside & region[row, column]
    outline = outer_polygon(cells, grid)
    height = np.median(upward.xyz[own, 1]) if own.any() else plane.height
    return SupportSurface(
        "", "patch", float(height), outline, abs(signed_area(outline)), int(own.sum())
    )


def _named(
    found: list[SupportSurface],
    points_gv: PointCloud,
    band: float,
    config: FindSupports,
    is_floor_allowed: bool,
) -> tuple[SupportSurface, ...]:
    """Tell the floor from tables and patches, and name them, the largest first."""
    found = sorted(found, key=lambda surface: -surface.area_m2)
    if not found:
        return ()
    large = [s for s in found if s.area_m2 >= config.patch_share * found[0].area_m2]
    deepest = max(surface.height_gv for surface in large)
    lowest = next(s for s in large if s.height_gv >= deepest - band)
    area = points_gv.spacing**2
    below = float(area[points_gv.xyz[:, 1] > lowest.height_gv + 3 * band].sum() / area.sum())
    floor = lowest if is_floor_allowed and below <= config.below_floor_share else None
    kind_of: Callable[[SupportSurface], Literal["floor", "table", "patch"]] = lambda s: (  # noqa: E731
        "floor" if s is floor else "table" if any(s is one for one in large) else "patch"
    )
    named, counts = [], {"floor": 0, "table": 0, "patch": 0}
    for surface in found:
        kind = kind_of(surface)
        counts[kind] += 1
        name = kind if kind == "floor" else f"{kind}_{counts[kind]}"
        named.append(
            SupportSurface(
                name, kind, surface.height_gv, surface.outline_gv, surface.area_m2, surface.inliers
            )
        )
    return tuple(named)


def _thinned(points: PointCloud, limit: int) -> PointCloud:
    """Return at most ``limit`` points, evenly picked, their spacing grown to match."""
    if len(points) <= limit:
        return points
    kept = points.subset(np.linspace(0, len(points) - 1, limit).astype(int))
    growth = np.sqrt(len(points) / limit)
    return PointCloud(kept.xyz, kept.rgb, kept.normal, kept.spacing * growth, kept.confidence)
