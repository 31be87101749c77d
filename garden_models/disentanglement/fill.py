"""Make the background: the scene's points without the objects, their holes filled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from garden_models.disentanglement.label import cloud_in_gv
from garden_models.disentanglement.photo_colours import PhotoView
from garden_models.disentanglement.support_hole import FillHole, fill_hole
from garden_models.geometry.rigid import homogeneous, invert_rigid
from garden_models.progress import Progress, silent
from garden_models.scene import (
    OK,
    Background,
    BadInput,
    GravityView,
    ObjectMasks,
    PointCloud,
    PointLabels,
    Reconstruction,
    SupportSurface,
    Verdict,
)


@dataclass(frozen=True)
class CleanBackground:
    """How leftovers are recognised, and how holes are filled."""

    near: float = 0.15
    """Leftovers lie within this share of the object's size around it."""
    link_spacings: float = 2.5
    """Points closer than this many spacings hang together."""
    most_leftover: float = 0.1
    """A cluster of more points than this share of the object's is a thing of its own."""
    layer_spacings: float = 2.5
    hole: FillHole = field(default_factory=FillHole)


def clean_background(
    reconstruction: Reconstruction,
    gravity_view: GravityView,
    labels: Sequence[PointLabels],
    masks: Sequence[ObjectMasks],
    config: CleanBackground = CleanBackground(),
    progress: Progress = silent,
) -> Background:
    """Remove every labelled object, its floating leftovers, and fill its support's hole.

    ``labels`` and ``masks`` are of the same targets in the same order. A target whose hole
    cannot be filled is named in the verdict. Raises BadInput if labels belong to another
    cloud or to other targets.
    """
    points = cloud_in_gv(reconstruction.points_world, gravity_view)
    if [label.name for label in labels] != [mask.target.name for mask in masks]:
        raise BadInput("labels and masks must be of the same targets in the same order")
    for label in labels:
        if len(label.probability) != len(points):
            raise BadInput(
                f"the labels of {label.name} are for {len(label.probability)} points, but the "
                f"reconstruction has {len(points)}: label it again"
            )
    owner = _owners(labels, len(points))
    for i, mask in enumerate(masks):
        owner[_leftovers(points, owner, i, mask.support, config)] = i
    removed = {label.name: int((owner == i).sum()) for i, label in enumerate(labels)}
    background = points.subset(owner < 0)
    filled = np.zeros(len(background), bool)
    verdict = OK
    views = _photo_views(reconstruction, gravity_view, masks)
    for i, mask in enumerate(masks):
        progress(i / len(masks), f"filling the hole of {mask.target.name}")
        remark, background, filled = _filled(
            background, filled, points.subset(owner == i), mask, views, config
        )
        if remark:
            verdict = verdict.worst(Verdict("ok", (remark,)))
    return Background(background, filled, removed, verdict)


def _photo_views(
    reconstruction: Reconstruction, gravity_view: GravityView, masks: Sequence[ObjectMasks]
) -> tuple[PhotoView, ...]:
    """Return all photos with the pixels of every removed object."""
    world_from_gv = invert_rigid(gravity_view.gv_from_world)
    nothing = [np.zeros(view.depth.shape, bool) for view in reconstruction.views]
    return tuple(
        PhotoView(
            view.K,
            homogeneous(view.camera_from_world) @ world_from_gv,
            view.rgb,
            view.depth,
            np.logical_or.reduce([nothing[i], *(mask.masks[i] for mask in masks)]),
        )
        for i, view in enumerate(reconstruction.views)
    )


def _owners(labels: Sequence[PointLabels], count: int) -> np.ndarray:
    """Return for each point the index of the target it belongs to most surely, or -1."""
    owner = np.full(count, -1)
    best = np.zeros(count)
    for i, label in enumerate(labels):
        mine = (label.probability >= label.threshold) & (label.probability > best)
        owner[mine], best[mine] = i, label.probability[mine]
    return owner


def _filled(
    background: PointCloud,
    filled: Bool[np.ndarray, " n"],
    removed: PointCloud,
    mask: ObjectMasks,
    views: tuple[PhotoView, ...],
    config: CleanBackground,
) -> tuple[str, PointCloud, Bool[np.ndarray, " m"]]:
    """Fill one target's hole; return a remark if that was not possible."""
    name = mask.target.name
    if not len(removed):
        return f"{name} took no points away, so it left no hole", background, filled
    if mask.support is None:
        return f"the support of {name} is unknown, so no hole was filled", background, filled
    filling = fill_hole(background, removed, mask.support, views, config.hole)
    if filling is None:
        remark = f"too little of the support around {name} was seen to fill its hole"
        return remark, background, filled
    keep = ~filling.replaced
    joined = _joined(background.subset(keep), filling.points_gv)
    flags = np.concatenate([filled[keep], np.ones(len(filling.points_gv), bool)])
    return "", joined, flags


def _leftovers(
    points: PointCloud,
    owner: np.ndarray,
    index: int,
    support: SupportSurface | None,
    config: CleanBackground,
) -> np.ndarray:
    """Return the indices of small clusters that float where a target was taken away."""
    taken = owner == index
    if not taken.any():
        return np.zeros(0, int)
    low, high = np.percentile(points.xyz[taken], [1, 99], axis=0)
    reach = config.near * float((high - low).max())
    floating = owner < 0
    if support is not None:
        floating &= points.xyz[:, 1] < support.height_gv - config.layer_spacings * points.spacing
    outer = floating & _in_box(points.xyz, low - 2 * reach, high + 2 * reach)
    candidates = np.flatnonzero(outer)
    if not len(candidates):
        return candidates
    cluster = _clusters(points.subset(candidates), config.link_spacings)
    inner = _in_box(points.xyz[candidates], low - reach, high + reach)
    count = np.bincount(cluster)
    # A cluster that reaches out of the box is part of something else.
    stays = np.bincount(cluster, ~inner) > 0
    stays |= count > config.most_leftover * taken.sum()
    return candidates[~stays[cluster]]


def _clusters(points: PointCloud, link_spacings: float) -> np.ndarray:
    """Return the connected component of each point."""
    reach = link_spacings * float(np.median(points.spacing))
    pairs = cKDTree(points.xyz).query_pairs(reach, output_type="ndarray")
    n = len(points)
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1])


def _in_box(
    xyz: Float[np.ndarray, "n 3"], low: Float[np.ndarray, "3"], high: Float[np.ndarray, "3"]
) -> Bool[np.ndarray, " n"]:
    """Tell which points lie in a box."""
    return np.asarray(((xyz >= low) & (xyz <= high)).all(axis=1))


def _joined(a: PointCloud, b: PointCloud) -> PointCloud:
    """Return the points of both clouds."""
    return PointCloud(
        np.concatenate([a.xyz, b.xyz]),
        np.concatenate([a.rgb, b.rgb]),
        np.concatenate([a.normal, b.normal]),
        np.concatenate([a.spacing, b.spacing]),
        np.concatenate([a.confidence, b.confidence]),
    )
