"""One box in one photo, a model asked with boxes: masks in all views, points, support."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from garden_models.geometry.rotation import yaw_gv
from garden_models.scene import BadGeometry, ObjectMasks, Rivals
from garden_models.segmentation.mask_model import MaskAnswer, MaskRequest
from garden_models.segmentation.promptable import segment_by_model
from tests.garden_models.segmentation.ray_scene import (
    RayScene,
    Solid,
    look_at,
    render,
    table_with,
    target_box,
)

CRATE = Solid("box", (0, -0.1, 0), (0.1, 0.1, 0.08), (200, 60, 40), 1, yaw=0.4)
LEFT = Solid("box", (-0.1, -0.1, 0), (0.1, 0.1, 0.08), (200, 60, 40), 1)
RIGHT = Solid("box", (0.08, -0.12, 0), (0.08, 0.12, 0.08), (50, 90, 180), 2)
SCREEN = Solid("box", (0, -0.25, -0.5), (0.3, 0.3, 0.01), (30, 30, 30), 3)

Change = Callable[[int, np.ndarray], np.ndarray]


@cache
def room(*objects):
    """Six photos all around a table."""
    angles = np.radians(np.arange(0, 360, 60))
    cameras = [look_at((1.2 * np.sin(a), -0.7, -1.2 * np.cos(a)), (0, -0.1, 0)) for a in angles]
    return render(RayScene(table_with(objects), cameras, size=(120, 90), focal=120.0))


class Instances:
    """Answers the mask of the label whose own box overlaps the asked box most."""

    def __init__(self, reconstruction, labels, change: Change = lambda view, mask: mask) -> None:
        self.views, self.labels, self.change = reconstruction.views, labels, change
        self.asked: list[int] = []

    def __call__(self, request: MaskRequest) -> MaskAnswer:
        view = next(i for i, v in enumerate(self.views) if np.array_equal(v.rgb, request.rgb))
        self.asked.append(view)
        masks = [self.change(view, self._best(view, box)) for box in request.boxes]
        return MaskAnswer(np.stack(masks), np.full(len(masks), 0.9, np.float32))

    def _best(self, view, box):
        def overlap(mask):
            row, column = np.nonzero(mask)
            low = np.maximum([column.min(), row.min()], box[:2])
            high = np.minimum([column.max() + 1, row.max() + 1], box[2:])
            both = np.prod(np.maximum(high - low, 0))
            own = (np.ptp(column) + 1) * (np.ptp(row) + 1)
            return both / (own + np.prod(box[2:] - box[:2]) - both)

        masks = [self.labels[view] == label for label in np.unique(self.labels[view]) if label < 50]
        return max(masks, key=overlap)


def segmented(objects, target=1, view=0, change: Change = lambda view, mask: mask, rivals=()):
    reconstruction, gravity, labels = room(*objects)
    predict = Instances(reconstruction, labels, change)
    masks = segment_by_model(
        reconstruction,
        gravity,
        target_box("crate", target, labels, view),
        predict,
        Rivals(tuple(target_box(str(r), r, labels, view) for r in rivals)),
    )
    return masks, labels, predict


def overlaps(masks: ObjectMasks, labels, label=1):
    true = [image == label for image in labels]
    return [(m & t).sum() / max((m | t).sum(), 1) for m, t in zip(masks.masks, true, strict=True)]


@cache
def crate():
    return segmented((CRATE,))


def test_the_mask_reaches_every_view_also_the_opposite_ones() -> None:
    masks, labels, _ = crate()
    assert min(overlaps(masks, labels)) > 0.95
    assert masks.verdict.status == "ok", masks.verdict


def test_its_points_are_the_objects_and_it_stands_on_the_table() -> None:
    masks, _, _ = crate()
    local = (masks.points_gv.xyz - CRATE.centre) @ yaw_gv(CRATE.yaw)
    assert (np.abs(local) < np.array(CRATE.half) + 0.025).all()
    assert len(masks.points_gv) > 300
    assert masks.support is not None
    assert masks.support.height_gv == pytest.approx(0, abs=0.005)
    assert masks.occluded.max() < 0.2


def test_no_view_is_asked_more_than_twice() -> None:
    _, _, predict = crate()
    assert predict.asked.count(0) == 1
    assert max(predict.asked.count(view) for view in range(6)) <= 2


def test_objects_that_touch_are_told_apart_by_their_masks() -> None:
    masks, labels, _ = segmented((LEFT, RIGHT), rivals=(2,))
    assert min(overlaps(masks, labels)) > 0.9
    assert masks.points_gv.xyz[:, 0].max() < 0.03


def test_of_overlapping_masks_in_the_boxs_photo_the_smaller_has_the_pixels() -> None:
    """A model may take what stands on a thing for a part of it."""

    def greedy(view, mask):
        _, _, labels = room(LEFT, RIGHT)
        left = (labels[view] == 1) & mask
        return labels[view] < 50 if left.any() and (labels[view] > 0).any() else mask

    masks, labels, _ = segmented((LEFT, RIGHT), rivals=(2,), change=greedy)
    assert (masks.masks[0] & (labels[0] == 2)).sum() == 0


def test_a_hidden_view_is_not_asked_and_hidden_is_how_much_of_it_is() -> None:
    masks, labels, predict = segmented((CRATE, SCREEN), view=3)
    assert (labels[0] == 1).sum() < 30
    assert 0 not in predict.asked
    assert not masks.masks[0].any()
    assert masks.occluded[0] > 0.6


def test_a_view_in_which_the_model_takes_something_else_is_left_out() -> None:
    def wall_in_one(view, mask):
        _, _, labels = room(CRATE)
        return labels[view] == 91 if view == 1 and (labels[view] == 91).any() else mask

    masks, labels, _ = segmented((CRATE,), change=wall_in_one)
    assert not masks.masks[1].any()
    assert min(np.delete(overlaps(masks, labels), 1)) > 0.95


def test_a_model_that_contradicts_the_geometry_everywhere_is_degraded() -> None:
    def table(view, mask):
        _, _, labels = room(CRATE)
        return mask if view == 0 else labels[view] == 90

    masks, _, _ = segmented((CRATE,), change=table)
    assert masks.verdict.status == "degraded"
    assert "contradicts" in "; ".join(masks.verdict.reasons)


def test_a_first_mask_of_something_else_is_degraded() -> None:
    """The table under the crate, not the crate."""

    def table(view, mask):
        _, _, labels = room(CRATE)
        return labels[view] == 93

    masks, _, _ = segmented((CRATE,), change=table)
    assert masks.verdict.status == "degraded"
    assert "by geometry" in "; ".join(masks.verdict.reasons)


def test_an_unsure_model_is_degraded() -> None:
    reconstruction, gravity, labels = room(CRATE)
    predict = Instances(reconstruction, labels)

    def unsure(request):
        answer = predict(request)
        return MaskAnswer(answer.masks, np.full(len(answer.scores), 0.2, np.float32))

    masks = segment_by_model(reconstruction, gravity, target_box("crate", 1, labels, 0), unsure)
    assert masks.verdict.status == "degraded" and "unsure" in masks.verdict.reasons[0]


def test_a_model_that_finds_nothing_in_the_box_is_said_so() -> None:
    with pytest.raises(BadGeometry, match="finds nothing in the box of 'crate'"):
        segmented((CRATE,), change=lambda view, mask: np.zeros_like(mask))
