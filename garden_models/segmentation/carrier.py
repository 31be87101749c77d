"""Find what carries the thing in a box: the local surface that its foot stands on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage
from scipy.spatial import cKDTree

from garden_models.geometry.outline import Grid
from garden_models.geometry.peaks import density_peaks
from garden_models.physics.support_surfaces import SurfacePlane, fit_plane, height_noise
from garden_models.segmentation.node_graph import NodeGraph

UPWARD_COS = np.cos(np.radians(35.0))
MAX_PEAKS = 12
MIN_SHARE = 0.02
"""Least share of the area that faces up near the box for a candidate."""
FOOT_SHARE = 0.15
"""The lowest part of the object, as a share of its height, in which its foot is sought."""
TOUCH = 4.0
"""A foot touches the support within this many spacings."""
STICKS_OUT = 0.2
"""A support has at least this share of its area outside of the box."""
SMOOTHING = 0.15
"""Width of the local height field's smoothing, as a share of the object's size."""


@dataclass(frozen=True)
class BoxEvidence:
    """What the box's photo says of the nodes: whether they project into it, are seen in
    it, and how central they are, weighted by their picture area (sums to 1).
    """

    inside: Bool[np.ndarray, " n"]
    seen: Bool[np.ndarray, " n"]
    central: Float[np.ndarray, " n"]


@dataclass(frozen=True)
class Carrier:
    """A local support, and what stands on it.

    ``below`` is how far each node lies below the support's surface (metres, negative:
    above), which may bulge; ``plane`` is that surface's mean around the foot, ``band`` how
    far from it points still belong to it, ``inliers`` which nodes do. ``core`` are the
    connected nodes above it that fill the box's middle. ``score`` (0..1) says how well it
    explains the box, ``foot_xz`` where the core stands.
    """

    plane: SurfacePlane
    band: float
    below: Float[np.ndarray, " n"]
    inliers: Bool[np.ndarray, " n"]
    core: Bool[np.ndarray, " n"]
    foot_xz: Float[np.ndarray, "2"]
    score: float


def find_carrier(
    graph: NodeGraph,
    evidence: BoxEvidence,
    *,
    max_tilt_deg: float,
    band_sigma: float,
    min_score: float,
) -> Carrier | None:
    """Return the surface that best carries what fills the box's middle; None: nothing does.

    Candidates are the peaks along gravity of what faces up near the box. A good one
    sticks out of the box (a level surface that ends inside of it is part of the object),
    has most of the box's middle above it, and touches the foot of that all around.
    """
    xyz = graph.cloud.xyz
    upward = np.abs(graph.cloud.normal[:, 1]) >= UPWARD_COS
    if upward.sum() < 20:
        return None
    band = max(
        band_sigma * height_noise(graph.cloud.subset(upward)), float(np.median(graph.cloud.spacing))
    )
    area = graph.cloud.spacing[upward] ** 2
    limit = float(np.tan(np.radians(max_tilt_deg)))
    best: Carrier | None = None
    for peak in density_peaks(xyz[upward, 1], area, band / 2, min_share=MIN_SHARE)[:MAX_PEAKS]:
        plane = SurfacePlane(peak.position, np.zeros(2))
        for width in (2.0, 2.0, 2.0, 1.5, 1.0):
            near = np.abs(plane.residual(xyz[upward])) <= width * band
            if near.sum() >= 10:
                plane = fit_plane(xyz[upward][near], area[near], limit)
        carrier = _judged(graph, evidence, upward, plane, band, limit)
        if carrier is not None and (best is None or carrier.score > best.score):
            best = carrier
    return best if best is not None and best.score >= min_score else None


def _judged(
    graph: NodeGraph,
    evidence: BoxEvidence,
    upward: Bool[np.ndarray, " n"],
    plane: SurfacePlane,
    band: float,
    limit: float,
) -> Carrier | None:
    """Score a candidate, its plane refined around the foot of what it would carry."""
    xyz, spacing = graph.cloud.xyz, graph.cloud.spacing
    for _ in range(2):
        below = plane.residual(xyz)
        core = _central_part(graph, evidence, evidence.inside & (below < -band))
        if not core.any():
            return None
        foot = core & (below > FOOT_SHARE * below[core].min() - 2 * band)
        standing = xyz[foot if foot.any() else core][:, [0, 2]]
        size = float(np.linalg.norm(np.ptp(xyz[core][:, [0, 2]], axis=0)))
        away = np.linalg.norm(xyz[:, [0, 2]] - standing.mean(0), axis=1)
        local = upward & (np.abs(below) <= band) & (away < size + 4 * band)
        if local.sum() < 10:
            return None
        plane = fit_plane(xyz[local], spacing[local] ** 2, limit)
    field = _height_field(graph, plane, band, upward, core, evidence)
    inliers = upward & (np.abs(field) <= band)
    if inliers.sum() < 10:
        return None
    score = _score(graph, evidence, inliers, core, foot)
    return Carrier(plane, band, field, inliers, core, standing.mean(0), score)


def _height_field(
    graph: NodeGraph,
    plane: SurfacePlane,
    band: float,
    upward: Bool[np.ndarray, " n"],
    core: Bool[np.ndarray, " n"],
    evidence: BoxEvidence,
) -> Float[np.ndarray, " n"]:
    """Return how far nodes lie below the support as it bulges and sags around the foot.

    What faces up, hangs together with the plane's own nodes and stays within a seventh of
    the object's height of it is taken for support; its height is smoothed over (x, z) and
    continued under the object. A flat support stays the plane.
    """
    xyz = graph.cloud.xyz
    below = plane.residual(xyz)
    room = max(2 * band, FOOT_SHARE * float(-below[core].min()))
    parts = graph.components(upward & (np.abs(below) <= room))
    rooted = np.zeros(parts.max(initial=-1) + 2, bool)
    own = upward & (np.abs(below) <= band) & (parts >= 0)
    counts = np.bincount(parts[own], minlength=len(rooted))
    rooted[: len(counts)] = counts > 0.02 * max(own.sum(), 1)
    rooted[-1] = False
    soil = rooted[parts]

    size = float(np.linalg.norm(np.ptp(xyz[core][:, [0, 2]], axis=0)))
    cell = max(size / 40, float(np.median(graph.cloud.spacing)))
    grid = Grid.around(xyz[:, [0, 2]], cell, margin=1, max_cells=256)
    row, column, _ = grid.cells_of(xyz[:, [0, 2]])
    flat = row * grid.shape[1] + column
    cells = grid.shape[0] * grid.shape[1]
    count = np.bincount(flat[soil], minlength=cells).reshape(grid.shape).astype(float)
    total = np.bincount(flat[soil], below[soil], minlength=cells).reshape(grid.shape)
    # Each cell counts once, however many points it has; a faint flat plane fills the rest.
    seen = count > 0
    mean = np.where(seen, total / np.maximum(count, 1), 0.0)
    sigma = SMOOTHING * size / grid.cell
    weight = ndimage.gaussian_filter(seen.astype(float), sigma, mode="nearest")
    bulge = ndimage.gaussian_filter(mean, sigma, mode="nearest") / (weight + 1e-3)
    return below - bulge[row, column]


def _central_part(
    graph: NodeGraph, evidence: BoxEvidence, above: Bool[np.ndarray, " n"]
) -> Bool[np.ndarray, " n"]:
    """Return the connected part of the nodes above that holds most of the box's middle."""
    parts = graph.components(above)
    share = np.bincount(parts[above], evidence.central[above], 1)
    return above & (parts == int(share.argmax()) if share.max() > 0 else np.zeros_like(above))


def _score(
    graph: NodeGraph,
    evidence: BoxEvidence,
    inliers: Bool[np.ndarray, " n"],
    core: Bool[np.ndarray, " n"],
    foot: Bool[np.ndarray, " n"],
) -> float:
    """Return (share of the box's middle that is carried) x (share of the foot that touches)
    x (how far the surface sticks out of the box, up to enough).
    """
    xyz, spacing = graph.cloud.xyz, graph.cloud.spacing
    if not foot.any():
        return 0.0
    distance, _ = cKDTree(xyz[inliers][:, [0, 2]]).query(xyz[foot][:, [0, 2]])
    touching = float(np.mean(distance < TOUCH * np.median(spacing)))
    area = spacing**2
    outside = float(area[inliers & ~evidence.inside].sum() / area[inliers].sum())
    return float(evidence.central[core].sum()) * touching * min(1.0, outside / STICKS_OUT)
