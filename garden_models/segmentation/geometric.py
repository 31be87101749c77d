"""Segment a target geometry first: what stands on its support inside the box, carried to
all views, refined in the image, and voted back until points and pixels agree.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Float32, Int
from scipy.spatial import cKDTree

from garden_models.geometry.rigid import homogeneous, invert_rigid, transform_points
from garden_models.progress import Progress, silent
from garden_models.scene import GravityView, ObjectMasks, PointCloud, Reconstruction, Target
from garden_models.segmentation.box import box_in_view
from garden_models.segmentation.carrier import Carrier, find_carrier
from garden_models.segmentation.config import Segment
from garden_models.segmentation.hull import VisualHull, carve
from garden_models.segmentation.node_graph import NodeGraph, node_graph
from garden_models.segmentation.node_labels import Candidate, Probabilities, Votes, label_nodes
from garden_models.segmentation.occlusion import compare_outline
from garden_models.segmentation.region import BoxView, box_evidence, points_around
from garden_models.segmentation.support import support_of
from garden_models.segmentation.tidy import tidy_mask
from garden_models.segmentation.verdict import judge
from garden_models.segmentation.view_masks import (
    ViewWindow,
    label_pixels,
    open_window,
    votes_of_views,
)


@dataclass(frozen=True)
class _Scene:
    """A reconstruction in Gravity-View: fused points, and each view's camera_from_gv."""

    reconstruction: Reconstruction
    cloud: PointCloud
    cameras: tuple[Float[np.ndarray, "4 4"], ...]


@dataclass(frozen=True)
class _Refined:
    """Where views and points came to agree: node probabilities, the target's probability
    in each view's window, and the support of the last votes.
    """

    labels: Probabilities
    windows: list[ViewWindow | None]
    targets: list[Float32[np.ndarray, "h w"] | None]
    votes: Votes


DEFAULT = Segment()


def segment(
    reconstruction: Reconstruction,
    gravity_view: GravityView,
    target: Target,
    rivals: tuple[Target, ...] = (),
    config: Segment = DEFAULT,
    progress: Progress = silent,
) -> ObjectMasks:
    """Return the target's mask in every view, its own fused points, and its support.

    ``rivals`` are other targets whose boxes may touch this one: what lies in both boxes is
    divided between them. Raises BadInput if the box's photo is not registered or the box
    is outside of it, BadGeometry if nothing was reconstructed in the box. The verdict is
    degraded, with the reason, where the evidence is weak.
    """
    progress(0.0, "collecting points around the box")
    scene = _in_gv(reconstruction, gravity_view)
    boxes, nodes = _boxes(scene, target, rivals, config)
    graph = node_graph(
        nodes,
        reach=config.reach,
        colour_sigma=config.colour_sigma,
        crease_deg=config.crease_deg,
    )
    candidates = tuple(_candidate(graph, box, config) for box in boxes)
    progress(0.15, "dividing points")
    labels = label_nodes(graph, candidates)
    refined = _refined(scene, boxes[0], graph, candidates, labels, config, progress)

    progress(0.92, "collecting the object's points")
    masks = tuple(
        _mask(view.depth.shape, refined, i) for i, view in enumerate(reconstruction.views)
    )
    points = _own_points(scene, graph, candidates[0], refined)
    own = graph.cloud.subset(refined.labels.argmax(1) == 1)
    outlined = [
        compare_outline(own, mask, view, camera)
        for view, mask, camera in zip(reconstruction.views, masks, scene.cameras, strict=True)
    ]
    carrier = candidates[0].carrier
    support = None
    if carrier is not None:
        centres = np.stack([invert_rigid(camera)[:3, 3] for camera in scene.cameras])
        support = support_of(target.name, carrier, graph.cloud, scene.cloud, centres)
    verdict = judge(
        target, boxes[0].box, masks, len(points), outlined, support, refined.labels[:, 1]
    )
    progress(1.0, "done")
    return ObjectMasks(
        target,
        tuple(view.photo for view in reconstruction.views),
        masks,
        np.array([one.occluded for one in outlined]),
        points,
        support,
        verdict,
    )


def _in_gv(reconstruction: Reconstruction, gravity_view: GravityView) -> _Scene:
    """Turn points, normals and cameras to Gravity-View."""
    gv_from_world = gravity_view.gv_from_world
    points = reconstruction.points_world
    cloud = PointCloud(
        transform_points(gv_from_world, points.xyz),
        points.rgb,
        points.normal @ gv_from_world[:3, :3].T,
        points.spacing,
        points.confidence,
    )
    world_from_gv = invert_rigid(gv_from_world)
    cameras = tuple(
        homogeneous(view.camera_from_world) @ world_from_gv for view in reconstruction.views
    )
    return _Scene(reconstruction, cloud, cameras)


def _boxes(
    scene: _Scene, target: Target, rivals: tuple[Target, ...], config: Segment
) -> tuple[tuple[BoxView, ...], PointCloud]:
    """Return the target's box, then those of the rivals that some of its points lie in, and
    the points around all of them; more than ``max_nodes`` are thinned evenly.
    """
    registered = {view.photo for view in scene.reconstruction.views}
    boxes: list[BoxView] = []
    around: list[Int[np.ndarray, " m"]] = []
    # A rival on a photo that is not registered has its own verdict; here it says nothing.
    for one in (target, *(rival for rival in rivals if rival.photo in registered)):
        box = box_in_view(one, scene.reconstruction)
        view = BoxView(one, box, scene.reconstruction.views[box.view], scene.cameras[box.view])
        if boxes and not _overlap(scene.cloud, around[0], boxes[0], view, config.box_margin):
            continue
        index = points_around(
            scene.cloud,
            view,
            surroundings=config.surroundings,
            before=config.depth_before,
            behind=config.depth_behind,
        )
        boxes.append(view)
        around.append(index)
    index = np.unique(np.concatenate(around))
    nodes = scene.cloud.subset(index)
    if len(index) > config.max_nodes:
        nodes = scene.cloud.subset(
            index[np.linspace(0, len(index) - 1, config.max_nodes).astype(int)]
        )
        nodes = replace(nodes, spacing=nodes.spacing * np.sqrt(len(index) / config.max_nodes))
    return tuple(boxes), nodes


def _overlap(
    cloud: PointCloud, around: Int[np.ndarray, " m"], own: BoxView, other: BoxView, margin: float
) -> bool:
    """Tell whether more than a hundredth of the points in one box lie in another's as well."""
    xyz = cloud.xyz[around]
    xyz = xyz[own.inside(own.project(xyz), margin)]
    return bool(other.inside(other.project(xyz), margin).sum() > 0.01 * len(xyz))


def _candidate(graph: NodeGraph, one: BoxView, config: Segment) -> Candidate:
    """Return a box's claim on the nodes."""
    evidence = box_evidence(graph.cloud, one, config.box_margin)
    carrier = find_carrier(
        graph,
        evidence,
        max_tilt_deg=config.max_tilt_deg,
        band_sigma=config.band_sigma,
        min_score=config.min_support_score,
    )
    if carrier is not None:
        core = carrier.core
    else:
        parts = graph.components(evidence.inside)
        share = np.bincount(parts[evidence.inside], evidence.central[evidence.inside], 1)
        core = (parts == int(share.argmax())) & evidence.inside
    centrality = np.where(evidence.inside, one.centrality(one.project(graph.cloud.xyz)), 0.0)
    return Candidate(evidence, centrality, carrier, core)


def _refined(
    scene: _Scene,
    box: BoxView,
    graph: NodeGraph,
    candidates: tuple[Candidate, ...],
    labels: Probabilities,
    config: Segment,
    progress: Progress,
) -> _Refined:
    """Let views and points correct each other for some rounds."""
    views, cameras = scene.reconstruction.views, scene.cameras
    tree = cKDTree(graph.cloud.xyz)
    wanted = labels[:, 1] > 0.4
    windows = [
        open_window(view, camera, graph.cloud, tree, wanted, box.box if i == box.box.view else None)
        for i, (view, camera) in enumerate(zip(views, cameras, strict=True))
    ]
    targets: list[Float32[np.ndarray, "h w"] | None] = [None] * len(views)
    shared, hull, votes = None, None, Votes(labels[:, 1], np.zeros(len(labels)))
    for turn in range(config.rounds + 1):
        counts = []
        for i, window in enumerate(windows):
            done = (turn + i / len(windows)) / (config.rounds + 1)
            progress(0.25 + 0.65 * done, f"refining {views[i].photo}")
            if window is not None:
                seen_hull: Float32[np.ndarray, "h w"] | None = (
                    None
                    if hull is None
                    else hull.silhouette(views[i].K, cameras[i], window.rows, window.columns)
                )
                targets[i], count = label_pixels(
                    window, labels[:, 1], shared, seen_hull, targets[i]
                )
                counts.append(count)
        shared = np.sum(counts, axis=0) if counts else None
        mean, seen = votes_of_views(windows, targets, len(labels))
        votes = Votes(mean, np.minimum(seen, 3) / 3)
        labels = label_nodes(graph, candidates, votes, labels)
        if turn < config.rounds:
            hull = _hull(scene, graph, candidates[0].carrier, labels, windows, targets)
    return _Refined(labels, windows, targets, votes)


def _hull(
    scene: _Scene,
    graph: NodeGraph,
    carrier: Carrier | None,
    labels: Probabilities,
    windows: list[ViewWindow | None],
    targets: list[Float32[np.ndarray, "h w"] | None],
) -> VisualHull | None:
    """Carve the target's hull around its nodes, above its support."""
    own = graph.cloud.xyz[labels[:, 1] > 0.5]
    if len(own) < 10:
        return None
    low, high = np.percentile(own, 0.5, axis=0), np.percentile(own, 99.5, axis=0)
    margin = 0.1 * (high - low) + 3 * float(np.median(graph.cloud.spacing))
    low, high = low - margin, high + margin
    if carrier is not None:
        floor = carrier.plane.height + float(carrier.foot_xz @ carrier.plane.slope)
        high[1] = max(min(high[1], floor + carrier.band), low[1] + margin[1])
    return carve(
        low,
        high,
        scene.reconstruction.views,
        scene.cameras,
        targets,
        [None if window is None else (window.rows, window.columns) for window in windows],
    )


def _mask(shape: tuple[int, ...], refined: _Refined, index: int) -> Bool[np.ndarray, "h w"]:
    """Return one view's mask."""
    mask = np.zeros(shape, bool)
    window, target = refined.windows[index], refined.targets[index]
    if window is not None and target is not None:
        evident = (window.node >= 0) & (refined.labels[np.maximum(window.node, 0), 1] > 0.5)
        mask[window.rows, window.columns] = tidy_mask(target > 0.5, evident)
    return mask


def _own_points(
    scene: _Scene, graph: NodeGraph, candidate: Candidate, refined: _Refined
) -> PointCloud:
    """Return the fused points whose nearest node is the target's.

    Nodes were thinned where there were many; points further from all nodes than the
    thinned nodes are from each other are no target.
    """
    own = refined.labels.argmax(1) == 1
    if not own.any():
        return scene.cloud.subset(np.zeros(0, np.int64))
    xyz = graph.cloud.xyz
    reach = 3 * float(np.median(graph.cloud.spacing))
    low, high = xyz[own].min(0) - reach, xyz[own].max(0) + reach
    near = np.flatnonzero(((scene.cloud.xyz >= low) & (scene.cloud.xyz <= high)).all(1))
    distance, index = cKDTree(xyz).query(
        scene.cloud.xyz[near], distance_upper_bound=reach, workers=2
    )
    hit = np.isfinite(distance)
    hit[hit] = own[index[hit]]
    return scene.cloud.subset(near[hit])
