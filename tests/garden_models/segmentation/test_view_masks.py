"""Points say what is the target; the image says where it ends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from garden_models.scene import View
from garden_models.segmentation.box import ViewBox
from garden_models.segmentation.view_masks import label_pixels, open_window, votes_of_views
from tests.garden_models.segmentation.clouds import BLUE, GREY, joined, sheet

SIZE = (120, 90)
K = np.array([[120.0, 0, 60], [0, 120.0, 45], [0, 0, 1]])
CAMERA = np.eye(4)
TRUE = np.zeros(SIZE[::-1], bool)
TRUE[30:60, 40:80] = True
WALL = sheet((0, 0, 2.4), (1.2, 0, 0), (0, 0.9, 0), (0, 0, -1), GREY, 0.03)
BOARD = sheet((0, 0, 2.0), (1 / 3, 0, 0), (0, 0.25, 0), (0, 0, -1), BLUE, 0.025)
NODES = joined(BOARD, WALL)
IS_BOARD = np.arange(len(NODES)) < len(BOARD)


def view(noise=3.0, depth=None):
    """A blue board before a grey wall."""
    rng = np.random.default_rng(0)
    rgb = np.where(TRUE[..., None], BLUE, GREY) + rng.normal(0, noise, (*TRUE.shape, 3))
    depth = np.where(TRUE, 2.0, 2.4) if depth is None else depth
    return View(
        "a", rgb.clip(0, 255).astype(np.uint8), depth, np.ones(TRUE.shape), K, CAMERA[:3], SIZE
    )


def window_of(one, nodes=NODES, wanted=IS_BOARD, box=None):
    return open_window(one, CAMERA, nodes, cKDTree(nodes.xyz), wanted, box)


def whole(window, part):
    out = np.zeros(TRUE.shape, part.dtype)
    out[window.rows, window.columns] = part
    return out


def labelled(window, target=IS_BOARD, colours=None, hull=None, start=None):
    return label_pixels(window, np.asarray(target, float), colours, hull, start)


def iou(a, b):
    return (a & b).sum() / (a | b).sum()


def test_a_window_holds_the_wanted_nodes_and_a_margin():
    window = window_of(view())
    assert window.rows.start < 25
    assert window.rows.stop > 65
    assert (window.rows.start, window.columns.start) >= (0, 0)
    assert window.columns.start < 35
    assert window.columns.stop > 85


def test_a_view_that_sees_hardly_any_wanted_node_has_no_window():
    few = IS_BOARD & (np.cumsum(IS_BOARD) <= 4)
    assert window_of(view(), wanted=few) is None
    behind = replace(NODES, xyz=NODES.xyz * [1, 1, -1])
    assert window_of(view(), nodes=behind) is None


def test_pixels_show_the_node_at_their_depth():
    window = window_of(view())
    shown = whole(window, IS_BOARD[np.maximum(window.node, 0)] & (window.node >= 0))
    assert iou(shown, TRUE) > 0.97


def test_the_mask_is_the_board():
    window = window_of(view())
    result, _ = labelled(window)
    assert 0 <= result.min() <= result.max() <= 1
    assert iou(whole(window, result > 0.5), TRUE) > 0.99


def test_where_points_are_off_the_image_decides_the_border():
    """The points of the board reach two pixels too far on all sides, as stereo's do."""
    fat = TRUE.copy()
    fat[28:62, 38:82] = True
    stretched = replace(NODES, xyz=NODES.xyz * np.where(IS_BOARD, 1.1, 1.0)[:, None] * [1, 1, 0])
    stretched.xyz[:, 2] = NODES.xyz[:, 2]
    window = window_of(view(depth=np.where(fat, 2.0, 2.4)), nodes=stretched)
    by_points = whole(window, IS_BOARD[np.maximum(window.node, 0)])
    assert iou(by_points, TRUE) < 0.85
    assert iou(whole(window, labelled(window)[0] > 0.5), TRUE) > 0.97


def test_a_hole_without_depth_is_filled_by_the_points_and_the_image():
    holed = np.where(TRUE, 2.0, 2.4)
    holed[35:55, 50:70] = 0
    window = window_of(view(depth=holed))
    assert iou(whole(window, labelled(window)[0] > 0.5), TRUE) > 0.98


def test_outside_of_its_own_box_nothing_is_target():
    box = ViewBox(0, np.array([40.0, 30.0]), np.array([60.0, 60.0]), (999, 999))
    window = window_of(view(), box=box)
    mask = whole(window, labelled(window)[0] > 0.5)
    assert mask[32:58, 42:58].all()
    assert not mask[:, 62:].any()


def test_what_misses_the_hull_is_not_target_where_points_say_nothing():
    unknown = view(depth=np.zeros(TRUE.shape))
    window = window_of(unknown, nodes=BOARD, wanted=np.ones(len(BOARD), bool))
    left = np.zeros(TRUE.shape, bool)
    left[:, :60] = True
    hull = left[window.rows, window.columns]
    mask = whole(window, labelled(window, np.ones(len(BOARD)), hull=hull)[0] > 0.5)
    assert mask[32:58, 42:56].all()
    assert not mask[:, 64:].any()


def test_the_colours_that_it_saw_are_those_of_the_labels():
    window = window_of(view(noise=0.0))
    _, counts = labelled(window)
    rest, target = counts
    assert target.argmax() == window.bins[45 - window.rows.start, 60 - window.columns.start]
    assert rest.argmax() == window.bins[0, 0]
    assert target[rest.argmax()] < 0.05 * target.sum()


def test_a_second_round_stays_at_the_solution():
    window = window_of(view())
    first, counts = labelled(window)
    second, _ = labelled(window, colours=counts, start=first)
    assert iou(whole(window, second > 0.5), TRUE) > 0.99
    blurred = ((first > 0.05) & (first < 0.95)).sum()
    assert ((second > 0.05) & (second < 0.95)).sum() <= blurred


def test_votes_give_the_nodes_what_their_pixels_show():
    window = window_of(view())
    result, _ = labelled(window)
    mean, seen = votes_of_views([window, None, window], [result, None, result], len(NODES))
    assert set(seen) == {0, 2}
    assert np.mean(mean[IS_BOARD] > 0.5) > 0.9
    visible_wall = ~IS_BOARD & (seen > 0)
    assert np.mean(mean[visible_wall] < 0.5) > 0.99


def test_a_node_hidden_behind_the_board_has_no_vote():
    window = window_of(view())
    result, _ = labelled(window)
    _, seen = votes_of_views([window], [result], len(NODES))
    hidden = ~IS_BOARD & (np.abs(NODES.xyz[:, :2]) < [0.35, 0.25]).all(1)
    assert hidden.sum() > 100
    assert not seen[hidden].any()
    assert seen[IS_BOARD].all()


def test_a_node_that_a_view_shows_beside_its_window_is_voted_no_target():
    window = window_of(view())
    result = np.ones(window.node.shape, np.float32)
    mean, seen = votes_of_views([window], [result], len(NODES))
    beside = (seen > 0) & (NODES.xyz[:, 0] / NODES.xyz[:, 2] * 120 + 60 < window.columns.start - 1)
    assert beside.sum() > 10
    assert (mean[beside] == 0).all()


@pytest.mark.parametrize("gain", [0.3, 1.5])
def test_a_dark_or_bright_picture_is_cut_as_well(gain):
    one = view()
    lit = replace(one, rgb=(one.rgb * gain).clip(0, 255).astype(np.uint8))
    window = window_of(lit)
    assert iou(whole(window, labelled(window)[0] > 0.5), TRUE) > 0.98
