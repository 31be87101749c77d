"""Carry a mask from the photo of its box to all views, by geometry and the model together.

The points that the first mask covers say where the object is in the next view; the model is
asked there with a box around them, and its mask adds the points of the sides that were not
seen before. Views follow each other from near to far. A mask that contradicts the points and
the depth is refused: the view then counts as not showing the object, which costs less than a
wrong outline.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage

from garden_models.geometry.camera import camera_centre
from garden_models.progress import Progress, silent
from garden_models.scene import PointCloud, View
from garden_models.segmentation.mask_agreement import Agreement, agreement
from garden_models.segmentation.mask_model import MaskBoxes, MaskRequest
from garden_models.segmentation.point_visibility import Sight, sight

ROUNDS = 2
"""The second time, every view is asked with a box around the points of all views."""

BOX_MARGIN = 0.08
"""Boxes are drawn around points, whose outermost pixels are missing, with this margin."""

SAME_BOX = 0.9
"""A view is not asked again with a box that overlaps the last one by more than this."""

RIM_PX = 2
"""The rim of a mask of this width neither claims points nor disclaims them."""

LEAST_SHOWN = 0.1
"""A view that shows less than this share of the points does not show the object."""

FEWEST = 8
"""Fewer points than this give no box."""

Mask = Bool[np.ndarray, "h w"]


@dataclass(frozen=True)
class PropagatedMasks:
    """Masks in the order of the views; all False where the object is not seen or not sure.

    ``share`` is, for each point, the share of the views showing it whose mask holds it (0 if
    none does); ``scores`` the model's own in the views that were asked (NaN: not asked).
    ``refused`` are the views whose mask contradicts points or depth.
    """

    masks: tuple[Mask, ...]
    share: Float[np.ndarray, " n"]
    scores: Float[np.ndarray, " views"]
    refused: tuple[int, ...]


@dataclass
class _ViewState:
    """What is known of one view so far."""

    view: View
    sight: Sight
    box: Float[np.ndarray, "4"] | None = None
    mask: Mask | None = None
    score: float = float("nan")
    refused: bool = False


def propagate(
    first: Mask,
    first_view: int,
    views: Sequence[View],
    cameras_from_gv: Sequence[Float[np.ndarray, "4 4"]],
    nodes: PointCloud,
    predict: MaskBoxes,
    progress: Progress = silent,
) -> PropagatedMasks:
    """Return the masks of all views, given the ``first`` one, and how far points agree.

    ``nodes`` are points (GV) of the object and its surroundings.
    """
    states = [
        _ViewState(view, sight(nodes, view, camera))
        for view, camera in zip(views, cameras_from_gv, strict=True)
    ]
    states[first_view].mask = first
    share = _shares(states, len(nodes))
    for turn in range(ROUNDS):
        order = _near_to_far(states, first_view, nodes.xyz[share >= 0.5])
        for step, index in enumerate(order):
            progress((turn + step / len(order)) / ROUNDS, f"asking in {views[index].photo}")
            _ask(states[index], nodes, share >= 0.5, predict)
            share = _shares(states, len(nodes))
    return PropagatedMasks(
        tuple(np.zeros(s.view.depth.shape, bool) if s.mask is None else s.mask for s in states),
        share,
        np.array([s.score for s in states]),
        tuple(i for i, s in enumerate(states) if s.refused),
    )


def _ask(
    state: _ViewState, nodes: PointCloud, own: Bool[np.ndarray, " n"], predict: MaskBoxes
) -> None:
    """Ask the model in one view, and keep its mask if points and depth agree with it."""
    box = _box_around(state, nodes, own)
    if box is None:
        state.box = state.mask = None
        state.refused, state.score = False, float("nan")
        return
    if state.box is not None and _overlap(box, state.box) > SAME_BOX:
        fits = state.mask is None or agreement(state.mask, state.view, state.sight, nodes, own).ok
        if fits:
            return
    answer = predict(MaskRequest(state.view.rgb, box[None]))
    mask: Mask = np.asarray(answer.masks[0], bool)
    state.box, state.score = box, float(answer.scores[0])
    found: Agreement = agreement(mask, state.view, state.sight, nodes, own)
    state.mask = mask if found.ok else None
    state.refused = not found.ok


def _box_around(
    state: _ViewState, nodes: PointCloud, own: Bool[np.ndarray, " n"]
) -> Float[np.ndarray, "4"] | None:
    """Return a box around the projected points; None if the view does not show them."""
    inside = own & (state.sight.projection.flat >= 0)
    if inside.sum() < max(FEWEST, LEAST_SHOWN * own.sum()):
        return None
    if 1.0 - state.sight.hidden_share(inside, nodes) < LEAST_SHOWN:
        return None
    pixels = state.sight.projection.pixels[inside]
    low, high = np.percentile(pixels, 1, axis=0), np.percentile(pixels, 99, axis=0)
    margin = BOX_MARGIN * (high - low) + 1.0
    limit = np.array(state.view.size, float)
    low, high = np.clip(low - margin, 0, limit), np.clip(high + margin, 0, limit)
    return None if (high - low < 2.0).any() else np.concatenate([low, high])


def _shares(states: Sequence[_ViewState], count: int) -> Float[np.ndarray, " n"]:
    """Return for each point the share of views showing it whose mask holds it.

    A mask's rim says nothing: depth blends across outlines.
    """
    held, shown = np.zeros(count), np.zeros(count)
    for state in states:
        if state.mask is not None:
            inner = _without_rim(state.mask)
            held += state.sight.inside(inner)
            shown += state.sight.visible & ~state.sight.inside(state.mask & ~inner)
    return np.where(shown > 0, held / np.maximum(shown, 1), 0.0)


def _without_rim(mask: Mask) -> Mask:
    """Return the mask without its rim, unless little would be left of it."""
    inner: Mask = ndimage.binary_erosion(mask, iterations=RIM_PX)
    return inner if inner.sum() > 0.3 * mask.sum() else mask


def _near_to_far(
    states: Sequence[_ViewState], first: int, points: Float[np.ndarray, "n 3"]
) -> list[int]:
    """Return the other views, each next to one before it as seen from the object."""
    middle = np.median(points, axis=0) if len(points) else np.zeros(3)
    rays = np.stack([camera_centre(state.sight.camera_from_points) for state in states]) - middle
    rays /= np.maximum(np.linalg.norm(rays, axis=1, keepdims=True), 1e-12)
    cosine = rays @ rays.T
    order, left = [first], [i for i in range(len(states)) if i != first]
    while left:
        nearest = max(left, key=lambda i: (float(cosine[i, order].max()), -i))
        order.append(nearest)
        left.remove(nearest)
    return order[1:]


def _overlap(a: Float[np.ndarray, "4"], b: Float[np.ndarray, "4"]) -> float:
    """Return the intersection over union of two boxes."""
    sides = np.maximum(np.minimum(a[2:], b[2:]) - np.maximum(a[:2], b[:2]), 0)
    both = float(sides.prod())
    union = float((a[2:] - a[:2]).prod() + (b[2:] - b[:2]).prod()) - both
    return both / max(union, 1e-12)
