"""Box in, masks out, on rooms whose true masks are known."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from garden_models.geometry.rigid import homogeneous, rigid, transform_points
from garden_models.geometry.rotation import axis_angle, yaw_gv
from garden_models.scene import BadGeometry, BadInput, Rivals, Target
from garden_models.segmentation.geometric import segment
from tests.garden_models.segmentation.clouds import cloud
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
HANGING = Solid("box", (0, -0.5, 0), (0.1, 0.1, 0.08), (200, 60, 40), 1, yaw=0.4)


@cache
def room(*objects, height=0.7, at=-0.1):
    """Six photos all around a table."""
    angles = np.radians(np.arange(0, 360, 60))
    cameras = [look_at((1.2 * np.sin(a), -height, -1.2 * np.cos(a)), (0, at, 0)) for a in angles]
    return render(RayScene(table_with(objects), cameras, size=(120, 90), focal=120.0))


def overlaps(masks, labels, label):
    """Intersection over union with the true mask in every view."""
    true = [image == label for image in labels]
    return [(m & t).sum() / (m | t).sum() for m, t in zip(masks.masks, true, strict=True)]


@pytest.fixture(scope="module")
def crate():
    reconstruction, gravity, labels = room(CRATE)
    masks = segment(reconstruction, gravity, target_box("crate", 1, labels, 0))
    return masks, labels


def test_a_box_on_a_table_has_its_true_mask_in_every_view(crate):
    masks, labels = crate
    assert min(overlaps(masks, labels, 1)) >= 0.9
    assert masks.verdict.status == "ok"


def test_its_points_are_those_of_the_object(crate):
    """In Gravity-View, within the noise of depth: none of the table, none of the walls."""
    masks, _ = crate
    local = (masks.points_gv.xyz - CRATE.centre) @ yaw_gv(CRATE.yaw)
    assert (np.abs(local) < np.array(CRATE.half) + 0.025).all()
    assert len(masks.points_gv) > 300


def test_it_stands_on_the_table_at_the_tables_height(crate):
    masks, _ = crate
    assert masks.support.height_gv == pytest.approx(0, abs=0.005)


def test_in_full_view_hardly_anything_of_it_is_hidden(crate):
    masks, _ = crate
    assert masks.occluded.max() < 0.15


def test_masks_have_their_views_order_and_size(crate):
    masks, labels = crate
    assert masks.photos == tuple(f"photo_{i:02d}.png" for i in range(6))
    assert [mask.shape for mask in masks.masks] == [image.shape for image in labels]


@pytest.mark.parametrize(("name", "label", "rival"), [("left", 1, 2), ("right", 2, 1)])
def test_two_things_that_touch_are_told_apart_by_their_boxes(name, label, rival):
    reconstruction, gravity, labels = room(LEFT, RIGHT)
    masks = segment(
        reconstruction,
        gravity,
        target_box(name, label, labels, 0),
        Rivals((target_box("rival", rival, labels, 0),)),
    )
    assert min(overlaps(masks, labels, label)) >= 0.9
    assert masks.verdict.status == "ok"


def test_a_thing_that_hangs_in_the_air_is_degraded_as_nothing_carries_it():
    reconstruction, gravity, labels = room(HANGING, at=-0.4)
    masks = segment(reconstruction, gravity, target_box("lamp", 1, labels, 0))
    assert masks.support is None
    assert masks.verdict.status == "degraded"
    (reason,) = masks.verdict.reasons
    assert "Nothing carries 'lamp'" in reason
    assert min(overlaps(masks, labels, 1)) >= 0.9


@pytest.mark.parametrize("loose", [-0.15, -0.25])
def test_a_box_that_cuts_the_object_is_degraded_and_says_to_draw_it_larger(loose):
    reconstruction, gravity, labels = room(CRATE)
    masks = segment(reconstruction, gravity, target_box("crate", 1, labels, 0, loose))
    assert masks.verdict.status == "degraded"
    assert any("draw a box that holds all of it" in reason for reason in masks.verdict.reasons)


def test_the_frame_and_place_of_the_world_do_not_matter(crate):
    """Everything turned and shifted together: the same masks, the same points in GV."""
    masks, labels = crate
    reconstruction, gravity, _ = room(CRATE)
    move = rigid(axis_angle(np.array([1.0, -2.0, 0.5]), 1.1), np.array([4.0, 2.0, -7.0]))
    back = np.linalg.inv(move)
    there = elsewhere(reconstruction, move)
    turned = replace(
        gravity,
        gv_from_world=gravity.gv_from_world @ back,
        down_world=move[:3, :3] @ gravity.down_world,
    )
    again = segment(there, turned, target_box("crate", 1, labels, 0))
    assert min(overlaps(again, [m.astype(int) for m in masks.masks], 1)) > 0.98
    assert len(again.points_gv) == pytest.approx(len(masks.points_gv), rel=0.02)


def elsewhere(reconstruction, move):
    """The reconstruction in another world: ``move`` leads there."""
    points = reconstruction.points_world
    back = np.linalg.inv(move)
    views = tuple(
        replace(view, camera_from_world=(homogeneous(view.camera_from_world) @ back)[:3])
        for view in reconstruction.views
    )
    moved = replace(
        points,
        xyz=transform_points(move, points.xyz),
        normal=points.normal @ move[:3, :3].T,
    )
    return replace(reconstruction, views=views, points_world=moved)


def test_an_empty_reconstruction_says_that_nothing_was_reconstructed():
    reconstruction, gravity, labels = room(CRATE)
    empty = replace(reconstruction, points_world=cloud(np.zeros((0, 3))))
    with pytest.raises(BadGeometry, match="Nothing was reconstructed inside the box of 'crate'"):
        segment(empty, gravity, target_box("crate", 1, labels, 0))


def test_a_box_on_an_unknown_photo_is_refused():
    reconstruction, gravity, _ = room(CRATE)
    with pytest.raises(BadInput, match="is not in the capture"):
        segment(reconstruction, gravity, Target("crate", "other.png", (0, 0, 99, 99)))


def test_an_object_that_the_boxs_picture_cuts_is_found_whole_in_the_others():
    aims = [(0.0, 0.45 if number == 0 else -0.1, 0.0) for number in range(6)]
    angles = np.radians(np.arange(0, 360, 60))
    cameras = [
        look_at((1.2 * np.sin(a), -0.7, -1.2 * np.cos(a)), aim)
        for a, aim in zip(angles, aims, strict=True)
    ]
    scene = RayScene(table_with((CRATE,)), cameras, size=(120, 90), focal=120.0)
    reconstruction, gravity, labels = render(scene)
    assert (labels[0][0] == 1).any()
    masks = segment(reconstruction, gravity, target_box("crate", 1, labels, 0))
    assert min(overlaps(masks, labels, 1)) >= 0.9


def test_a_box_exactly_around_the_object_is_no_reason_to_doubt_it():
    reconstruction, gravity, labels = room(CRATE)
    masks = segment(reconstruction, gravity, target_box("crate", 1, labels, 0, loose=0.0))
    assert masks.verdict.status == "ok"


@pytest.mark.parametrize("small", [0.03, 0.08])
def test_a_box_drawn_a_little_too_small_still_holds_the_whole_object(small):
    reconstruction, gravity, labels = room(CRATE)
    masks = segment(reconstruction, gravity, target_box("crate", 1, labels, 0, loose=-small))
    assert min(overlaps(masks, labels, 1)) >= 0.9
    assert masks.verdict.status == "ok"


def test_a_box_is_not_widened_over_a_thing_that_touches_the_object():
    """The two together end far outside of the one's box: that box is no tight one."""
    reconstruction, gravity, labels = room(LEFT, RIGHT)
    both = (
        target_box("left", 1, labels, 0),
        Rivals((target_box("right", 2, labels, 0),)),
    )
    masks = segment(reconstruction, gravity, *both)
    right = [image == 2 for image in labels]
    taken = [(m & r).sum() / r.sum() for m, r in zip(masks.masks, right, strict=True)]
    assert max(taken) < 0.05
