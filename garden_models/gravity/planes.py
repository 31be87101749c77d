"""Dominant planes: people build horizontal supports and walls that stand upright on them.

Every family of parallel planes may be the horizontal one; walls perpendicular to it support
it and sharpen it. Where all planes may be walls, gravity lies along their common line.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

from garden_models.geometry.camera import camera_centre
from garden_models.geometry.direction import (
    Form,
    axis_angle_deg,
    girdle_form,
    least_axis,
    soften,
)
from garden_models.geometry.plane import Plane, find_planes
from garden_models.gravity import camera_x_axes
from garden_models.gravity.protocol import Cue, Mode
from garden_models.scene import GravityEvidence, Reconstruction

METHOD = "planes"

DEPTH_TOLERANCE = 0.01
"""Thickness of a plane over the distance it is seen from: what stereo depth is good for."""
MAX_POINTS = 20000
MIN_POINTS = 200

STRUCTURE = np.radians(0.5)
"""How far from horizontal or upright a built surface is, with the bending that is left in a
photogrammetric model."""
CARELESS = np.radians(5.0)
"""How far from horizontal things lie that merely look flat: cushions, seats, leant books."""
CARELESS_SHARE = 0.3
PERPENDICULAR_DEG = 6.0
PARALLEL_DEG = 6.0
KERNEL_DEG = 2.0
"""Planes this far off the common axis count half (Cauchy kernel)."""
INDEPENDENT_PATCHES = 10.0
"""Depth errors are smooth: a plane of however many points has about this many free ones."""

SPOKEN = 0.8
"""Probability that one of the readings is right at all."""
LARGE_SHARE = 0.3
"""Share of the points on planes from which they surely are the room's or the furniture's."""
WALL_WEIGHT = 0.5
"""A wall is half the evidence for an axis that a horizontal surface is: a random axis is
perpendicular to some plane far more easily than parallel to its normal."""
BARE_LOG_ODDS, LADEN_LOG_ODDS = 2.0, 5.0
"""A horizontal surface that is seen from one side is a floor or a table rather than a
ceiling, and almost surely so if things stand on the seen side."""
BARE_SHARE, LADEN_SHARE = 0.1, 0.2
"""Shares of the points above a surface from which it may, and surely does, carry things;
stray points of the reconstruction make up the first."""


@dataclass(frozen=True)
class Surfaces:
    """The dominant planes, and for each the mean side (-1..1) of its normal the cameras see."""

    planes: tuple[Plane, ...]
    seen_side: Float[np.ndarray, " planes"]
    clutter: Float[np.ndarray, " planes"]


def thinned(points: Float[np.ndarray, "n 3"], cell: float) -> Int[np.ndarray, " m"]:
    """Return the first point of every cubic cell, so that points count by area."""
    cells = np.floor((points - points.min(0)) / cell).astype(np.int64)
    rows, columns, _ = cells.max(0) + 1
    key = (cells[:, 2] * columns + cells[:, 1]) * rows + cells[:, 0]
    return np.sort(np.unique(key, return_index=True)[1])


def dominant_surfaces(reconstruction: Reconstruction) -> Surfaces | None:
    """Find the dominant planes of the fused points; None where there are too few points."""
    cloud = reconstruction.points_world
    if len(cloud) < MIN_POINTS or not reconstruction.views:
        return None
    centres = np.array([camera_centre(v.camera_from_world) for v in reconstruction.views])
    points = cloud.xyz.astype(np.float64)
    seen_from = cKDTree(centres).query(points)[0]
    typical = float(np.median(seen_from))
    tolerance = cell = DEPTH_TOLERANCE * typical
    keep = thinned(points, cell)
    while len(keep) > MAX_POINTS:
        cell *= max(1.1, np.sqrt(len(keep) / MAX_POINTS))
        keep = keep[thinned(points[keep], cell)]
    if len(keep) < MIN_POINTS:
        keep = np.arange(len(cloud))
    points, normals = points[keep], cloud.normal[keep].astype(np.float64)
    # Depth errors grow with distance: far surfaces count less for the same area.
    weights = 1 / np.maximum(seen_from[keep] / typical, 0.5)
    planes = find_planes(points, normals, tolerance, weights=weights)
    if not planes:
        return None
    sides, clutter = [], []
    for plane in planes:
        heights = plane.heights(centres)
        sides.append(float(np.clip(heights / (2 * tolerance), -1, 1).mean()))
        clutter.append(standing(plane, planes, points, np.sign(sides[-1]), tolerance))
    return Surfaces(tuple(planes), np.array(sides), np.array(clutter))


def standing(
    plane: Plane,
    planes: list[Plane],
    points: Float[np.ndarray, "n 3"],
    side: float,
    tolerance: float,
) -> float:
    """Return the share of points over a plane's footprint that stand off it on ``side``.

    Walls do not count: they meet the ceiling as they meet the floor.
    """
    loose = np.ones(len(points), dtype=bool)
    for other in planes:
        upright = 90 - axis_angle_deg(other.normal, plane.normal) < PERPENDICULAR_DEG
        if upright and other.extent[0] > 0.5 * plane.extent[0]:
            loose[other.inliers] = False
    local = (points - plane.centre) @ plane.spread.T
    over = loose & np.all(np.abs(local) < 1.5 * plane.extent, axis=1)
    height = plane.heights(points) * side
    off = over & (height > 3 * tolerance) & (height < plane.extent[0])
    return float(off.sum() / max(over.sum(), 1))


def tilt_form(plane: Plane) -> Form:
    """Return the form of "the vertical is this plane's normal": its two tilts' precisions."""
    own = plane.thickness / (np.maximum(plane.extent, 1e-9) * np.sqrt(INDEPENDENT_PATCHES))
    precisions = 1 / (own**2 + STRUCTURE**2)
    return (plane.spread.T * precisions) @ plane.spread


def wall_form(plane: Plane) -> Form:
    """Return the form of "the vertical lies in this plane"."""
    own = plane.thickness / (max(plane.extent[1], 1e-9) * np.sqrt(INDEPENDENT_PATCHES))
    return girdle_form(plane.normal, float(np.hypot(own, STRUCTURE)))


def read_axis(axis: Float[np.ndarray, "3"], planes: tuple[Plane, ...]) -> tuple[Form, float, str]:
    """Return the form, weight and words of reading ``axis`` as the vertical."""
    form, horizontal, walls = np.zeros((3, 3)), [], []
    largest = max(p.share for p in planes)
    deviation = trusted = 0.0
    for plane in planes:
        angle = axis_angle_deg(plane.normal, axis)
        off = min(angle, 90 - angle)
        trust = plane.share / largest / (1 + (off / KERNEL_DEG) ** 2)
        if angle < PARALLEL_DEG:
            form += trust * tilt_form(plane)
            horizontal.append(plane.share)
        elif 90 - angle < PERPENDICULAR_DEG:
            form += trust * wall_form(plane)
            walls.append(plane.share)
        else:
            continue
        deviation += trust * off**2
        trusted += trust
    if trusted > 0:
        # Planes that agree badly with one another fix their common axis no better than that.
        form = soften(form, np.radians(np.sqrt(deviation / trusted)))
    weight = sum(horizontal) + WALL_WEIGHT * sum(walls)
    words = (
        f"{len(horizontal)} horizontal ({sum(horizontal):.0%} of points), "
        f"{len(walls)} upright ({sum(walls):.0%})"
    )
    return form, weight, words


def candidate_axes(planes: tuple[Plane, ...]) -> list[Float[np.ndarray, "3"]]:
    """Return normals, and common lines of walls that no normal runs along."""
    axes: list[Float[np.ndarray, "3"]] = []
    for plane in planes:
        if all(axis_angle_deg(plane.normal, axis) > PARALLEL_DEG for axis in axes):
            axes.append(plane.normal)
    for i, a in enumerate(planes[:4]):
        for b in planes[i + 1 : 4]:
            line = np.cross(a.normal, b.normal)
            if np.linalg.norm(line) > np.sin(np.radians(30)) and all(
                axis_angle_deg(line, axis) > PARALLEL_DEG for axis in axes
            ):
                axes.append(line / np.linalg.norm(line))
    return axes


def lone_walls(planes: tuple[Plane, ...]) -> list[tuple[Form, float, str]]:
    """Return the readings of parallel planes as walls, where nothing is perpendicular to them."""
    readings: list[tuple[Form, float, str]] = []
    for axis in candidate_axes(planes):
        angles = np.array([axis_angle_deg(plane.normal, axis) for plane in planes])
        parallel = [p for p, angle in zip(planes, angles, strict=True) if angle < PARALLEL_DEG]
        if parallel and not np.any(90 - angles < PERPENDICULAR_DEG):
            share = sum(p.share for p in parallel)
            form = np.sum([p.share / share * wall_form(p) for p in parallel], axis=0)
            walls = "one wall" if len(parallel) == 1 else f"{len(parallel)} parallel walls"
            words = f"{walls} ({share:.0%} of points)"
            readings.append((form, WALL_WEIGHT * share, words))
    return readings


def read(reconstruction: Reconstruction) -> Cue | None:
    """Return the planes' readings; None where no plane is found."""
    surfaces = dominant_surfaces(reconstruction)
    if surfaces is None:
        return None
    planes = surfaces.planes
    readings: list[tuple[Form, float, str]] = []
    for start in candidate_axes(planes):
        axis = start
        for _ in range(5):
            form, weight, words = read_axis(axis, planes)
            axis = least_axis(form)[0]
        if all(axis_angle_deg(axis, least_axis(other)[0]) > KERNEL_DEG for other, _, _ in readings):
            readings.append((form, weight, words))
    readings += lone_walls(planes)
    # Planes that hold few of the points say little about how the room is built.
    total = sum(weight for _, weight, _ in readings)
    spoken = SPOKEN * min(1.0, max(weight for _, weight, _ in readings) / LARGE_SHARE)
    modes: list[Mode] = []
    for form, weight, words in readings:
        probability = spoken * weight / total
        rough = probability * CARELESS_SHARE
        modes.append(Mode(form, probability - rough, words))
        modes.append(Mode(soften(form, CARELESS), rough, f"{words}, roughly"))
    return Cue(
        METHOD,
        tuple(modes),
        lambda down: plane_sign(surfaces, down),
        directions=tuple(plane.normal for plane in planes),
    )


def plane_sign(surfaces: Surfaces, down: Float[np.ndarray, "3"]) -> float:
    """Return log odds of ``down``: horizontal surfaces are mostly seen from above, the more
    surely if things stand on the seen side.
    """
    votes = total = 0.0
    for plane, side, clutter in zip(
        surfaces.planes, surfaces.seen_side, surfaces.clutter, strict=True
    ):
        cosine = float(plane.normal @ down)
        if abs(cosine) > np.cos(np.radians(2 * PARALLEL_DEG)):
            laden = float(np.clip((clutter - BARE_SHARE) / (LADEN_SHARE - BARE_SHARE), 0, 1))
            strength = BARE_LOG_ODDS + laden * (LADEN_LOG_ODDS - BARE_LOG_ODDS)
            votes -= plane.share * strength * side * np.sign(cosine)
            total += plane.share
    # A few percent of the points on horizontal planes decide nothing.
    return float(votes / max(total, 0.1))


def estimate(reconstruction: Reconstruction) -> GravityEvidence | None:
    """Return gravity from the planes; the cameras' habit helps to tell floors from walls."""
    cue = read(reconstruction)
    return None if cue is None else cue.alone(camera_x_axes.read(reconstruction))
