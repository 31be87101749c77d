"""Join the supports of the scene with those found under each object, without duplicates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from garden_models.geometry.outline import inside_polygon, signed_area
from garden_models.physics.config import MergeSupports
from garden_models.physics.prism import convex_hull_2d
from garden_models.scene import SupportSurface

Vertices = Float[np.ndarray, "v 3"]


def merge_supports(
    found: tuple[SupportSurface, ...],
    own: tuple[SupportSurface | None, ...],
    names: list[str],
    placed_gv: list[Vertices],
    config: MergeSupports = MergeSupports(),
) -> tuple[tuple[SupportSurface, ...], list[str]]:
    """Return all supports, and per object the name of what carries it ("" for nothing).

    An object's own support is one of the found surfaces if the object stands over it at
    nearly the same height; the found surface then takes the mean height seen under the
    objects that it carries, and its outline grows to their footprints: what stands there is
    carried there. If the top of another object is at that height, that object
    carries it. Else the own support is added.
    """
    # Bodies and supports share one space of names in a simulator.
    supports = [
        replace(one, name=f"support_{one.name}") if one.name in names else one for one in found
    ]
    carriers: list[str] = []
    for i, (support, vertices) in enumerate(zip(own, placed_gv, strict=True)):
        if support is None:
            carriers.append("")
            continue
        footprint = _footprint(vertices, config.foot)
        tolerance = config.same_height * float(np.ptp(vertices[:, 1]))
        carrier = _carrying_object(i, support, footprint, placed_gv, names, tolerance)
        if carrier is not None:
            carriers.append(carrier)
            continue
        index = _same_surface(supports, support, footprint, tolerance, config.least_overlap)
        if index is None:
            taken = {one.name for one in supports} | set(names)
            name = support.name if support.name not in taken else f"under_{names[i]}"
            supports.append(replace(support, name=name))
            index = len(supports) - 1
        supports[index] = _grown(supports[index], footprint)
        carriers.append(supports[index].name)
    for index, surface in enumerate(supports):
        heights = [
            one.height_gv
            for one, carrier in zip(own, carriers, strict=True)
            if one is not None and carrier == surface.name
        ]
        if heights:
            supports[index] = replace(surface, height_gv=float(np.mean(heights)))
    return tuple(supports), carriers


def _footprint(vertices: Vertices, foot: float) -> Float[np.ndarray, "k 2"]:
    """Return the convex outline (x, z) of the lowest part of an object."""
    y = vertices[:, 1]
    low = vertices[y >= y.max() - foot * np.ptp(y)]
    points = low if len(low) >= 3 else vertices
    return convex_hull_2d(points[:, [0, 2]])


def _carrying_object(
    index: int,
    support: SupportSurface,
    footprint: Float[np.ndarray, "k 2"],
    placed_gv: list[Vertices],
    names: list[str],
    tolerance: float,
) -> str | None:
    """Return the object whose top, under the footprint, is at the support's height."""
    for other, vertices in enumerate(placed_gv):
        if other == index:
            continue
        under = inside_polygon(vertices[:, [0, 2]], footprint)
        if under.sum() < 3:
            continue
        top, bottom = vertices[under, 1].min(), vertices[:, 1].max()
        is_top = abs(top - support.height_gv) <= tolerance
        if is_top and bottom - support.height_gv > 2 * tolerance:
            return names[other]
    return None


def _same_surface(
    supports: list[SupportSurface],
    support: SupportSurface,
    footprint: Float[np.ndarray, "k 2"],
    tolerance: float,
    least_overlap: float,
) -> int | None:
    """Return the index of the surface nearest in height that lies under the footprint."""
    best = None
    for index, one in enumerate(supports):
        gap = abs(one.height_gv - support.height_gv)
        if gap > tolerance or (best is not None and gap >= best[0]):
            continue
        if _overlap(footprint, one.outline_gv) >= least_overlap:
            best = (gap, index)
    return None if best is None else best[1]


def _overlap(footprint: Float[np.ndarray, "k 2"], outline: Float[np.ndarray, "m 2"]) -> float:
    """Return the share of a convex footprint that lies in an outline (by sampling)."""
    low, high = footprint.min(axis=0), footprint.max(axis=0)
    steps = (np.arange(16) + 0.5) / 16
    grid = np.stack(np.meshgrid(*(low + (high - low) * steps[:, None]).T), axis=-1).reshape(-1, 2)
    grid = grid[inside_polygon(grid, footprint)]
    return float(inside_polygon(grid, outline).mean()) if len(grid) else 0.0


def _grown(surface: SupportSurface, footprint: Float[np.ndarray, "k 2"]) -> SupportSurface:
    """Return the surface with an outline that contains the footprint."""
    if surface.kind == "floor" or inside_polygon(footprint, surface.outline_gv).all():
        return surface
    outline = convex_hull_2d(np.concatenate([surface.outline_gv, footprint]))
    return replace(surface, outline_gv=outline, area_m2=abs(signed_area(outline)))
