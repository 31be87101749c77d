"""Make the background: the scene's points without the objects, their holes filled."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from garden_models.disentanglement.config import CleanBackground
from garden_models.disentanglement.label import cloud_in_gv
from garden_models.disentanglement.photo_colours import PhotoView
from garden_models.disentanglement.support_hole import fill_hole
from garden_models.geometry.rigid import homogeneous, invert_rigid
from garden_models.progress import Progress, silent
from garden_models.scene import (
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
    for i, (label, mask) in enumerate(zip(labels, masks, strict=True)):
        owner[_hanging(points, owner, i, config)] = i
        owner[_rims(points, owner, i, label, mask.support, config)] = i
    removed = {label.name: int((owner == i).sum()) for i, label in enumerate(labels)}
    background = points.subset(owner < 0)
    filled = np.zeros(len(background), bool)
    remarks = _not_fillable(masks, removed)
    views = _photo_views(reconstruction, gravity_view, masks)
    taken = [points.subset(owner == i) for i in range(len(masks))]
    groups = _neighbours(taken, masks)
    for done, group in enumerate(groups):
        names = " and ".join(masks[i].target.name for i in group)
        progress(done / len(groups), f"filling the hole of {names}")
        support = masks[group[0]].support
        assert support is not None
        filling = fill_hole(background, [taken[i] for i in group], support, views, config.hole)
        if filling is None:
            remarks.append(f"too little of the support around {names} was seen to fill its hole")
            continue
        keep = ~filling.replaced
        background = _joined(background.subset(keep), filling.points_gv)
        filled = np.concatenate([filled[keep], np.ones(len(filling.points_gv), bool)])
    return Background(background, filled, removed, Verdict("ok", tuple(remarks)))


def _not_fillable(masks: Sequence[ObjectMasks], removed: dict[str, int]) -> list[str]:
    """Say of which targets no hole is filled, and why."""
    remarks = []
    for mask in masks:
        name = mask.target.name
        if not removed[name]:
            remarks.append(f"{name} took no points away, so it left no hole")
        elif mask.support is None:
            remarks.append(f"the support of {name} is unknown, so no hole was filled")
    return remarks


def _neighbours(taken: Sequence[PointCloud], masks: Sequence[ObjectMasks]) -> list[list[int]]:
    """Group targets that stood beside each other on one surface: their holes are one."""
    groups: list[list[int]] = []
    for i, mask in enumerate(masks):
        if mask.support is None or not len(taken[i]):
            continue
        near = [group for group in groups if any(_beside(taken, masks, i, j) for j in group)]
        merged = [i, *(j for group in near for j in group)]
        groups = [group for group in groups if group not in near] + [sorted(merged)]
    return groups


def _beside(taken: Sequence[PointCloud], masks: Sequence[ObjectMasks], i: int, j: int) -> bool:
    """Tell whether two targets stand at one height, closer than half of their size."""
    first, second = masks[i].support, masks[j].support
    boxes = [np.percentile(taken[k].xyz, [1, 99], axis=0) for k in (i, j)]
    size = max(float((high - low).max()) for low, high in boxes)
    if first is None or second is None:
        return False
    if abs(first.height_gv - second.height_gv) > 0.05 * size:
        return False
    gap = np.maximum(boxes[0][0] - boxes[1][1], boxes[1][0] - boxes[0][1])[[0, 2]]
    return bool(gap.max() < 0.5 * size)


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


def _hanging(
    points: PointCloud, owner: np.ndarray, index: int, config: CleanBackground
) -> np.ndarray:
    """Return the indices of clusters that hang in the air where a target was taken away.

    Whatever is linked to the support or to things around reaches out of the target's box.
    """
    candidates, cluster, count = _clusters_near(points, owner, index, None, config)
    small = count <= config.most_leftover * (owner == index).sum()
    return candidates[small[cluster]]


def _rims(
    points: PointCloud,
    owner: np.ndarray,
    index: int,
    label: PointLabels,
    support: SupportSurface | None,
    config: CleanBackground,
) -> np.ndarray:
    """Return the indices of small clusters above the support that are no thing of their own:

    they were nearly the target's, or they hang free of the support.
    """
    if support is None:
        return np.zeros(0, np.int64)
    candidates, cluster, count = _clusters_near(points, owner, index, support, config)
    likely = np.bincount(cluster, label.probability[candidates], len(count))
    height = (support.height_gv - points.xyz[candidates, 1]) / points.spacing[candidates]
    lowest = np.full(len(count), np.inf)
    np.minimum.at(lowest, cluster, height)
    goes = likely >= config.least_likely * np.maximum(count, 1)
    goes |= lowest > config.layer_spacings + config.link_spacings
    taken = (owner == index).sum()
    goes &= count <= config.most_rim * taken
    goes |= count <= config.most_speck * taken
    return candidates[goes[cluster]]


def _clusters_near(
    points: PointCloud,
    owner: np.ndarray,
    index: int,
    support: SupportSurface | None,
    config: CleanBackground,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return background points in clusters within the box of what a target took away.

    The answer is their indices, each one's cluster, and the clusters' sizes. With a support,
    only points above its layer are linked; clusters that reach out of the box are left out.
    """
    none = np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0, np.int64)
    taken = owner == index
    if not taken.any():
        return none
    low, high = np.percentile(points.xyz[taken], [1, 99], axis=0)
    reach = config.near * float((high - low).max())
    asked = (owner < 0) & _in_box(points.xyz, low - 2 * reach, high + 2 * reach)
    if support is not None:
        asked &= points.xyz[:, 1] < support.height_gv - config.layer_spacings * points.spacing
    candidates = np.flatnonzero(asked)
    if not len(candidates):
        return none
    cluster = _clusters(points.subset(candidates), config.link_spacings)
    inner = _in_box(points.xyz[candidates], low - reach, high + reach)
    within = (np.bincount(cluster, ~inner) == 0)[cluster]
    count = np.bincount(cluster)
    return candidates[within], cluster[within], count


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
