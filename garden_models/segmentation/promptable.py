"""Segment a target with a model that turns boxes into masks: SAM-3's tracker, SAM-2.

The model is asked in the photo of the box; the mask is carried to the other views by geometry
(``mask_propagation``). Points, support and what is hidden come from the same geometry as the
geometric method's, which also judges whether the model's object is one that stands there.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Bool

from garden_models.geometry.camera import camera_centre
from garden_models.progress import Progress, silent
from garden_models.scene import (
    BadGeometry,
    GravityView,
    ObjectMasks,
    Reconstruction,
    Rivals,
    Target,
    Verdict,
)
from garden_models.segmentation.carrier import BoxEvidence, Carrier, find_carrier
from garden_models.segmentation.config import Segment
from garden_models.segmentation.mask_model import MaskBoxes, MaskRequest
from garden_models.segmentation.mask_propagation import PropagatedMasks, propagate
from garden_models.segmentation.node_graph import NodeGraph, node_graph
from garden_models.segmentation.occlusion import compare_outline
from garden_models.segmentation.own_points import points_near
from garden_models.segmentation.region import BoxView, box_evidence, boxes_and_nodes
from garden_models.segmentation.scene_in_gv import SceneInGV, scene_in_gv
from garden_models.segmentation.support import support_of
from garden_models.segmentation.verdict import judge

LEAST_PIECE = 0.03
"""Pieces of the object's points smaller than this share of the largest are strays."""

LEAST_SCORE = 0.5
"""The model's own score under which it is unsure of its mask."""

MOST_REFUSED = 1 / 3
"""Share of the asked views whose masks were refused above which model and geometry disagree."""

LEAST_ALIKE = 0.25
"""Overlap of the model's object and of what stands on the support under which they disagree."""

OUTSIDE_BOX = 0.1
"""The first mask is cut this share of half the box outside of it."""

Mask = Bool[np.ndarray, "h w"]

DEFAULT = Segment()
NO_RIVALS = Rivals()


def segment_by_model(
    reconstruction: Reconstruction,
    gravity_view: GravityView,
    target: Target,
    predict: MaskBoxes,
    rivals: Rivals = NO_RIVALS,
    config: Segment = DEFAULT,
    progress: Progress = silent,
) -> ObjectMasks:
    """Return the target's mask in every view, its own fused points, and its support.

    Where masks of the target and of a rival in the same photo overlap, the smaller has the
    pixels. Raises BadInput if the photo of a box is not registered or a box is outside of it,
    BadGeometry if the model finds nothing in the box, or nothing was reconstructed there. The
    verdict is degraded, with the reason, where model and geometry disagree.
    """
    progress(0.0, "asking in the photo of the box")
    scene = scene_in_gv(reconstruction, gravity_view)
    boxes, nodes = boxes_and_nodes(scene, (target, *rivals.targets), config)
    box = boxes[0]
    first, score = _first_mask(boxes, predict)
    found = propagate(
        first,
        box.box.view,
        reconstruction.views,
        scene.cameras,
        nodes,
        predict,
        lambda share, doing: progress(0.1 + 0.7 * share, doing),
    )
    progress(0.8, "collecting the object's points")
    graph = node_graph(
        nodes, reach=config.reach, colour_sigma=config.colour_sigma, crease_deg=config.crease_deg
    )
    own = _without_strays(graph, found.share >= 0.5)
    points = points_near(scene.cloud, nodes, own)
    outlined = [
        compare_outline(nodes.subset(own), mask, view, camera)
        for view, mask, camera in zip(reconstruction.views, found.masks, scene.cameras, strict=True)
    ]
    evidence = box_evidence(nodes, box, config.box_margin)
    carrier = _carrier(graph, evidence, own, config)
    support = None
    if carrier is not None:
        centres = np.stack([camera_centre(camera) for camera in scene.cameras])
        support = support_of(target.name, carrier, nodes, scene.cloud, centres)
    verdict = judge(box, found.masks, points.xyz, outlined, support, found.share)
    alike = _likeness(graph, evidence, own, config)
    verdict = verdict.worst(_agreement(target.name, scene, found, score, alike))
    progress(1.0, "done")
    return ObjectMasks(
        target,
        tuple(view.photo for view in reconstruction.views),
        found.masks,
        np.array([one.occluded for one in outlined]),
        points,
        support,
        verdict,
    )


def _first_mask(boxes: tuple[BoxView, ...], predict: MaskBoxes) -> tuple[Mask, float]:
    """Return the target's mask in the photo of its box, and the model's score for it."""
    own = boxes[0]
    shared = [one for one in boxes if one.box.view == own.box.view]
    prompts = np.stack([np.concatenate([one.box.low, one.box.high]) for one in shared])
    answer = predict(MaskRequest(own.view.rgb, prompts))
    mask: Mask = np.array(answer.masks[0], bool)
    for other in answer.masks[1:]:
        if 0 < other.sum() < mask.sum():
            mask &= ~other
    rows, columns = np.nonzero(mask)
    pixels = np.stack([columns + 0.5, rows + 0.5], 1)
    outside = ~own.box.contains(pixels, OUTSIDE_BOX)
    mask[rows[outside], columns[outside]] = False
    if not mask.any():
        raise BadGeometry(
            f"the model finds nothing in the box of {own.target.name!r} on photo "
            f"{own.target.photo!r}; draw the box around one whole object"
        )
    return mask, float(answer.scores[0])


def _without_strays(graph: NodeGraph, own: Bool[np.ndarray, " n"]) -> Bool[np.ndarray, " n"]:
    """Drop points that hang together with few others of the object."""
    if not own.any():
        return own
    piece = graph.components(own)
    size = np.bincount(piece[own])
    out = own.copy()
    out[own] = (size >= LEAST_PIECE * size.max())[piece[own]]
    return out


def _carrier(
    graph: NodeGraph, evidence: BoxEvidence, own: Bool[np.ndarray, " n"], config: Segment
) -> Carrier | None:
    """Return what carries the object's points."""
    central = evidence.central * own
    if central.sum() <= 0:
        return None
    return _find(graph, replace(evidence, central=central / central.sum()), config)


def _likeness(
    graph: NodeGraph, evidence: BoxEvidence, own: Bool[np.ndarray, " n"], config: Segment
) -> float:
    """Return the overlap of the object's points, as far as the box's photo shows them, with
    what geometry alone takes for standing on a support in the box (NaN: nothing stands there).
    """
    carrier = _find(graph, evidence, config)
    if carrier is None:
        return float("nan")
    standing, mine = carrier.core & evidence.seen, own & evidence.seen
    return float((standing & mine).sum() / max((standing | mine).sum(), 1))


def _find(graph: NodeGraph, evidence: BoxEvidence, config: Segment) -> Carrier | None:
    return find_carrier(
        graph,
        evidence,
        max_tilt_deg=config.max_tilt_deg,
        band_sigma=config.band_sigma,
        min_score=config.min_support_score,
    )


def _agreement(
    name: str, scene: SceneInGV, found: PropagatedMasks, score: float, alike: float
) -> Verdict:
    """Say where model and geometry disagree."""
    reasons = []
    if score < LEAST_SCORE:
        reasons.append(
            f"The model is unsure of its mask of {name!r} (its own score is {score:.2f}); look at "
            "it, or draw the box again."
        )
    asked = int(np.isfinite(found.scores).sum())
    if found.refused and len(found.refused) > MOST_REFUSED * asked:
        photos = scene.reconstruction.views
        named = ", ".join(photos[i].photo for i in found.refused[:3])
        reasons.append(
            f"In {len(found.refused)} of {asked} photos the model's mask of {name!r} contradicts "
            f"its points or the depth ({named}): those photos were left out."
        )
    if alike < LEAST_ALIKE:
        reasons.append(
            f"What the model takes for {name!r} and what stands in its box by geometry overlap by "
            f"only {alike:.0%}: check its mask."
        )
    return Verdict("degraded" if reasons else "ok", tuple(reasons))
