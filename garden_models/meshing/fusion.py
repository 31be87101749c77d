"""Fuse depth and silhouettes of all views into a signed field around the object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from garden_models.meshing.config import MeshObject
from garden_models.meshing.evidence import Evidence, gather_evidence
from garden_models.meshing.extent import (
    coarse_hull,
    largest_gap_deg,
    robust_bounds,
    within_seen,
)
from garden_models.meshing.field import UNKNOWN_WEIGHT, keep_solid, solve_field
from garden_models.meshing.mirror import (
    EMPTY,
    SURFACE,
    UNKNOWN,
    MirrorPlane,
    find_mirror_plane,
)
from garden_models.meshing.object_view import ObjectView, depth_noise
from garden_models.meshing.standing import extend_below, stand_on
from garden_models.meshing.voxels import VoxelGrid
from garden_models.progress import Progress
from garden_models.scene import BadGeometry

LEAST_PIECE = 0.05
"""Pieces smaller than this share of the largest one are noise."""

SEEN_WEIGHT = 0.3
"""Sum of depth weights from which on a voxel counts as seen."""

MIRROR_WEIGHT = 0.3
"""Weight of mirrored evidence against evidence of the place itself."""

MOST_VOXELS = 5_000_000
MOST_ACTIVE = 1_500_000
"""Most voxels in the grid, and in the hull; they bound time and memory."""

ONE_SIDED_DEG = 180.0
"""A gap in the ring of cameras from which on the object has a side that no view faces."""

MIRROR_GAP_DEG = 120.0
"""A gap from which on it is worth looking for a mirror plane."""


@dataclass(frozen=True)
class FusedVolume:
    """The solved field on its grid, and what was assumed to close it.

    ``field`` is positive outside, in units of the truncation distance. ``foot`` is the share
    of the height over which the object was carried straight down so that it can stand.
    """

    grid: VoxelGrid
    field: Float[np.ndarray, "x y z"]
    truncation: float
    pieces: int
    mirror: MirrorPlane | None
    back_limited: bool
    foot: float


@dataclass(frozen=True)
class _Active:
    """Voxels that may be part of the object, with their evidence."""

    grid: VoxelGrid
    flat: Int[np.ndarray, " n"]
    centres_gv: Float[np.ndarray, "n 3"]
    evidence: Evidence
    truncation: float


def fuse_volume(
    views: Sequence[ObjectView],
    points_gv: Float[np.ndarray, "n 3"],
    support_height: float | None,
    config: MeshObject,
    progress: Progress,
) -> FusedVolume:
    """Return the object's signed field (GV, metres).

    Raises BadGeometry if the views leave no place for the object.
    """
    progress(0.0, "carving the silhouettes")
    coarse, solid = coarse_hull(views, points_gv, support_height, config.hull_outvoted_share)
    grid, flat = _fine_grid(views, points_gv, coarse, solid, support_height, config)
    truncation = max(3.0 * grid.spacing, 2.0 * depth_noise(list(views), points_gv))
    progress(0.1, f"fusing {len(views)} views in {len(flat)} voxels")
    centres = grid.centres(flat)
    evidence = gather_evidence(centres, views, truncation, config.hull_outvoted_share)
    active = _Active(grid, flat, centres, evidence, truncation)
    progress(0.7, "closing what was not seen")
    gap_deg = largest_gap_deg(views, points_gv.mean(axis=0))
    back_limited = gap_deg > ONE_SIDED_DEG
    mirror = _mirror(active, config) if config.mirror and gap_deg > MIRROR_GAP_DEG else None
    field = _solve(active, mirror, back_limited, points_gv, support_height)
    field, pieces = keep_solid(field, LEAST_PIECE)
    if pieces == 0:
        raise BadGeometry(
            "depth and masks of the object contradict each other everywhere; check its masks"
        )
    foot = 0.0
    if support_height is not None:
        field, foot = stand_on(field, grid, support_height, truncation)
    return FusedVolume(grid, field, truncation, pieces, mirror, back_limited, foot)


def _fine_grid(
    views: Sequence[ObjectView],
    points_gv: Float[np.ndarray, "n 3"],
    coarse: VoxelGrid,
    solid: Bool[np.ndarray, "x y z"],
    support_height: float | None,
    config: MeshObject,
) -> tuple[VoxelGrid, Int[np.ndarray, " n"]]:
    """Return a grid around the coarse hull and the voxels that lie in it.

    A voxel is as large as a pixel at the object in the better half of the views.
    """
    occupied = coarse.centres(np.flatnonzero(solid))
    low = occupied.min(axis=0) - coarse.spacing
    high = occupied.max(axis=0) + coarse.spacing
    if support_height is not None:
        high[1] = support_height
    extent = float((high - low).max())
    middle = points_gv.mean(axis=0)
    pixel = np.median([np.linalg.norm(v.centre_gv - middle) / v.focal_px for v in views])
    seen_low, seen_high = robust_bounds(points_gv)
    finest = float((seen_high - seen_low).max()) / config.max_resolution
    spacing = float(np.clip(pixel, finest, extent / config.min_resolution))
    spacing = max(
        spacing,
        extent / (1.5 * config.max_resolution),
        coarse.spacing * float(np.cbrt(solid.sum() / MOST_ACTIVE)),
        float(np.cbrt(np.prod(high - low) / MOST_VOXELS)),
    )
    pad = 2 * spacing
    if support_height is not None:
        # A layer of voxel centres lies half a voxel above the support, so that the zero
        # crossing between it and the layer below is the support itself.
        below = support_height + 2.5 * spacing
        low[1] = below - spacing * np.ceil((below - low[1] + pad) / spacing)
        high[1] = below
        low[[0, 2]] -= pad
        high[[0, 2]] += pad
    else:
        low, high = low - pad, high + pad
    grid = VoxelGrid.around(low, high - 1e-6 * spacing, spacing)
    every = np.arange(int(np.prod(grid.shape)))
    centres = grid.centres(every)
    near, inside = coarse.nearest(centres)
    keep = solid.ravel()[near] & inside
    if support_height is not None:
        keep &= centres[:, 1] < support_height
    return grid, every[keep]


def _mirror(active: _Active, config: MeshObject) -> MirrorPlane | None:
    """Look for a mirror plane among what was seen."""
    state = np.full(int(np.prod(active.grid.shape)), EMPTY, np.int8)
    state[active.flat] = _state(active)
    seen = active.centres_gv[_surface_voxels(active)]
    if len(seen) < 200:
        return None
    rng = np.random.default_rng(config.seed)
    sample = seen[rng.choice(len(seen), min(2500, len(seen)), replace=False)]

    def look(points_gv: Float[np.ndarray, "n 3"]) -> np.ndarray:
        near, inside = active.grid.nearest(points_gv)
        return np.where(inside, state[near], EMPTY)

    return find_mirror_plane(sample.astype(float), look)


def _state(active: _Active) -> np.ndarray:
    """Return SURFACE, EMPTY or UNKNOWN for each active voxel."""
    evidence = active.evidence
    seen = evidence.surface_weight > SEEN_WEIGHT
    near = np.abs(evidence.surface) < 0.75 * active.truncation
    state = np.full(len(seen), UNKNOWN, np.int8)
    state[seen & near] = SURFACE
    state[seen & (evidence.surface >= 0.75 * active.truncation)] = EMPTY
    state[evidence.hull > active.truncation] = EMPTY
    return state


def _surface_voxels(active: _Active) -> Bool[np.ndarray, " n"]:
    evidence = active.evidence
    close = np.abs(evidence.surface) < 0.75 * active.grid.spacing
    return close & (evidence.surface_weight > SEEN_WEIGHT) & (evidence.hull < active.truncation)


def _solve(
    active: _Active,
    mirror: MirrorPlane | None,
    back_limited: bool,
    points_gv: Float[np.ndarray, "n 3"],
    support_height: float | None,
) -> Float[np.ndarray, "x y z"]:
    """Weigh seen, mirrored and assumed values and solve for the field."""
    evidence, truncation = active.evidence, active.truncation
    surface = np.clip(evidence.surface / truncation, -1.0, 1.0)
    hull = np.clip(evidence.hull / truncation, -1.0, 1.0)
    weight = np.minimum(evidence.surface_weight, 1.0)
    unseen = evidence.surface_weight <= 1e-6
    assumed = np.where(evidence.foreign, 1.0, np.minimum(hull, -0.5))
    value = np.where(unseen, assumed, surface)
    if mirror is not None:
        value, weight, unseen = _mirrored(active, mirror, value, weight, unseen)
    # Silhouettes bound what nobody saw, but not behind the object if no view faces its back,
    # nor behind other things: there it ends where the seen points end.
    loose = unseen & (evidence.hidden | back_limited)
    value[loose] = np.where(
        _within_seen(active, loose, mirror, points_gv, support_height), value[loose], 1.0
    )
    weight = np.where(unseen, UNKNOWN_WEIGHT, np.maximum(weight, UNKNOWN_WEIGHT))
    carved = hull > value
    value = np.where(carved, hull, value)
    weight = np.where(carved & (hull > 0), 1.0, weight)
    target = np.ones(active.grid.shape, np.float32)
    trust = np.ones(active.grid.shape, np.float32)
    target.ravel()[active.flat] = value
    trust.ravel()[active.flat] = weight
    if support_height is not None:
        extend_below(target, trust, active.grid, support_height)
    return solve_field(target, trust)


def _within_seen(
    active: _Active,
    which: Bool[np.ndarray, " n"],
    mirror: MirrorPlane | None,
    points_gv: Float[np.ndarray, "n 3"],
    support_height: float | None,
) -> Bool[np.ndarray, " m"]:
    """Tell which of the chosen voxels lie among the seen (and mirrored) points."""
    low, high = robust_bounds(points_gv)
    seen = points_gv[((points_gv >= low) & (points_gv <= high)).all(axis=1)]
    if mirror is not None:
        seen = np.concatenate([seen, mirror.reflect(seen)])
    return within_seen(active.centres_gv[which], seen, support_height, active.truncation)


def _mirrored(
    active: _Active,
    mirror: MirrorPlane,
    value: Float[np.ndarray, " n"],
    weight: Float[np.ndarray, " n"],
    unseen: Bool[np.ndarray, " n"],
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"], Bool[np.ndarray, " n"]]:
    """Take the value of the mirrored place where only that one was seen."""
    of_voxel = np.full(int(np.prod(active.grid.shape)), -1, np.int64)
    of_voxel[active.flat] = np.arange(len(active.flat))
    near, inside = active.grid.nearest(mirror.reflect(active.centres_gv.astype(float)))
    other = np.where(inside, of_voxel[near], -1)
    seen_there = (other >= 0) & (active.evidence.surface_weight[other] > SEEN_WEIGHT)
    carved_there = (other < 0) | (active.evidence.hull[other] > 0)
    empty = unseen & carved_there
    borrowed = unseen & ~carved_there & seen_there
    value = np.where(borrowed, value[other], np.where(empty, 1.0, value))
    weight = np.where(borrowed | empty, MIRROR_WEIGHT, weight)
    return value, weight, unseen & ~borrowed & ~empty
