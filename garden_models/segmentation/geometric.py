"""Segment a target geometry first: what stands on its support inside the box, carried to
all views, refined in the image, and voted back until points and pixels agree.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float32
from scipy.spatial import cKDTree

from garden_models.geometry.rigid import invert_rigid
from garden_models.progress import Progress, silent
from garden_models.scene import (
    GravityView,
    ObjectMasks,
    Reconstruction,
    Rivals,
    Target,
    View,
)
from garden_models.segmentation.carrier import BoxEvidence, Carrier, find_carrier
from garden_models.segmentation.config import Segment
from garden_models.segmentation.hull import VisualHull, carve
from garden_models.segmentation.node_graph import NodeGraph, node_graph
from garden_models.segmentation.node_labels import (
    Candidate,
    Probabilities,
    Votes,
    label_nodes,
    nearness,
)
from garden_models.segmentation.occlusion import compare_outline
from garden_models.segmentation.own_points import points_near
from garden_models.segmentation.region import BoxView, box_evidence, boxes_and_nodes
from garden_models.segmentation.scene_in_gv import SceneInGV, scene_in_gv
from garden_models.segmentation.support import support_of
from garden_models.segmentation.tidy import tidy_mask
from garden_models.segmentation.tight_box import widened
from garden_models.segmentation.verdict import judge
from garden_models.segmentation.view_masks import (
    ViewWindow,
    label_pixels,
    open_window,
    votes_of_views,
)


@dataclass(frozen=True)
class _Refined:
    """Where views and points came to agree: node probabilities, and the target's
    probability in each view's window.
    """

    labels: Probabilities
    windows: list[ViewWindow | None]
    targets: list[Float32[np.ndarray, "h w"] | None]


DEFAULT = Segment()
NO_RIVALS = Rivals()


def segment(
    reconstruction: Reconstruction,
    gravity_view: GravityView,
    target: Target,
    rivals: Rivals = NO_RIVALS,
    config: Segment = DEFAULT,
    progress: Progress = silent,
) -> ObjectMasks:
    """Return the target's mask in every view, its own fused points, and its support.

    What lies in the target's box and a rival's is divided between them. Raises BadInput if
    the photo of a box is not registered or a box is outside of it, BadGeometry if nothing
    was reconstructed in one. The verdict is degraded, with the reason, where the evidence
    is weak.
    """
    progress(0.0, "collecting points around the box")
    scene = scene_in_gv(reconstruction, gravity_view)
    boxes, nodes = boxes_and_nodes(scene, (target, *rivals.targets), config)
    graph = node_graph(
        nodes,
        reach=config.reach,
        colour_sigma=config.colour_sigma,
        crease_deg=config.crease_deg,
    )
    boxes, candidates = zip(*(_candidate(graph, box, config) for box in boxes), strict=True)
    progress(0.15, "dividing points")
    labels = label_nodes(graph, candidates)
    refined = _refined(scene, boxes[0], graph, candidates, labels, config, progress)

    progress(0.92, "collecting the object's points")
    masks = tuple(_masks(reconstruction.views, refined))
    is_own = refined.labels.argmax(1) == 1
    points = points_near(scene.cloud, graph.cloud, is_own)
    own = graph.cloud.subset(is_own)
    outlined = [
        compare_outline(own, mask, view, camera)
        for view, mask, camera in zip(reconstruction.views, masks, scene.cameras, strict=True)
    ]
    carrier = candidates[0].carrier
    support = None
    if carrier is not None:
        centres = np.stack([invert_rigid(camera)[:3, 3] for camera in scene.cameras])
        support = support_of(target.name, carrier, graph.cloud, scene.cloud, centres)
    verdict = judge(boxes[0], masks, points.xyz, outlined, support, refined.labels[:, 1])
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


def _candidate(graph: NodeGraph, one: BoxView, config: Segment) -> tuple[BoxView, Candidate]:
    """Return a box, widened where it is a little too small, and its claim on the nodes."""
    evidence, carrier = _carried(graph, one, config)
    if carrier is not None:
        wider = widened(graph, one, carrier, config.box_margin)
        if wider is not one:
            one = wider
            evidence, carrier = _carried(graph, one, config)
    if carrier is not None:
        core = carrier.core
    else:
        parts = graph.components(evidence.inside)
        share = np.bincount(parts[evidence.inside], evidence.central[evidence.inside], 1)
        core = (parts == int(share.argmax())) & evidence.inside
    centrality = np.where(evidence.inside, one.centrality(one.project(graph.cloud.xyz)), 0.0)
    near = nearness(graph.cloud.xyz, core)
    return one, Candidate(evidence, centrality, carrier, core, near)


def _carried(graph: NodeGraph, one: BoxView, config: Segment) -> tuple[BoxEvidence, Carrier | None]:
    """Return what a box says of the nodes, and what carries the thing in it."""
    evidence = box_evidence(graph.cloud, one, config.box_margin)
    carrier = find_carrier(
        graph,
        evidence,
        max_tilt_deg=config.max_tilt_deg,
        band_sigma=config.band_sigma,
        min_score=config.min_support_score,
    )
    return evidence, carrier


def _refined(
    scene: SceneInGV,
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
    shared: Float[np.ndarray, "2 bins"] | None = None
    hull: VisualHull | None = None
    for turn in range(config.rounds + 1):
        counts = []
        for i, window in enumerate(windows):
            done = (turn + i / len(windows)) / (config.rounds + 1)
            progress(0.25 + 0.65 * done, f"refining {views[i].photo}")
            if window is not None:
                silhouette = _silhouette(hull, views[i], cameras[i], window)
                targets[i], count = label_pixels(
                    window, labels[:, 1], shared, silhouette, targets[i]
                )
                counts.append(count)
        shared = np.sum(counts, axis=0) if counts else None
        mean, seen = votes_of_views(windows, targets, len(labels))
        labels = label_nodes(graph, candidates, Votes(mean, np.minimum(seen, 3) / 3), labels)
        if turn < config.rounds:
            hull = _hull(scene, graph, candidates[0].carrier, labels, windows, targets)
    return _Refined(labels, windows, targets)


def _silhouette(
    hull: VisualHull | None, view: View, camera: Float[np.ndarray, "4 4"], window: ViewWindow
) -> Bool[np.ndarray, "h w"] | None:
    return None if hull is None else hull.silhouette(view.K, camera, window.rows, window.columns)


def _hull(
    scene: SceneInGV,
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


def _masks(views: tuple[View, ...], refined: _Refined) -> Iterator[Bool[np.ndarray, "h w"]]:
    """Yield the views' masks."""
    for view, window, target in zip(views, refined.windows, refined.targets, strict=True):
        mask = np.zeros(view.depth.shape, bool)
        if window is not None and target is not None:
            label = refined.labels[np.maximum(window.node, 0), 1]
            evident = (window.node >= 0) & (label > 0.5)
            mask[window.rows, window.columns] = tidy_mask(target > 0.5, evident)
        yield mask
