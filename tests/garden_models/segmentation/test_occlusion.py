"""How much of an object a view hides, by the outline of its points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from garden_models.geometry.rigid import rigid
from garden_models.scene import View
from garden_models.segmentation.occlusion import compare_outline
from tests.garden_models.segmentation.clouds import cloud, moved, sheet

SIZE = (200, 160)
K = np.array([[200.0, 0, 100], [0, 200.0, 80], [0, 0, 1]])
BOARD = sheet((0, 0, 2.0), (0.4, 0, 0), (0, 0.4, 0), (0, 0, -1))
"""Square, 80 pixels wide, in the middle of the picture."""


def view(depth):
    return View(
        "a",
        np.zeros((160, 200, 3), np.uint8),
        np.broadcast_to(depth, (160, 200)).astype(float),
        np.ones((160, 200)),
        K,
        np.eye(4)[:3],
        SIZE,
    )


def seen_mask(columns=(60, 140)):
    mask = np.zeros((160, 200), bool)
    mask[40:120, slice(*columns)] = True
    return mask


def behind_it():
    """The depth of the board, and of a wall a metre behind it."""
    return np.where(seen_mask(), 2.0, 3.0)


def outlined(mask, depth, x=0.0, points=BOARD):
    return compare_outline(points, mask, view(depth), rigid(np.eye(3), np.array([x, 0.0, 0.0])))


def test_an_object_in_full_view_agrees_with_its_mask_and_is_not_hidden():
    both = outlined(seen_mask(), behind_it())
    assert both.occluded < 0.02
    assert both.overlap > 0.9


@pytest.mark.parametrize("share", [0.25, 0.5, 0.75])
def test_what_something_nearer_covers_is_hidden(share):
    border = 60 + int(80 * share)
    depth = np.where(np.arange(200) < border, 1.0, behind_it())
    both = outlined(seen_mask((border, 140)), depth)
    assert both.occluded == pytest.approx(share, abs=0.04)
    assert both.overlap > 0.85


@pytest.mark.parametrize("share", [0.25, 0.5, 0.75])
def test_what_the_pictures_border_cuts_is_hidden(share):
    gone = int(80 * share)
    depth = np.where(seen_mask((0, 80 - gone)), 2.0, 3.0)
    both = outlined(seen_mask((0, 80 - gone)), depth, x=-(60 + gone) * 0.01)
    assert both.occluded == pytest.approx(share, abs=0.04)
    assert both.overlap > 0.85


def test_where_the_view_sees_past_the_object_nothing_hides_it():
    """The mask leaves a half out, and there the wall behind is seen: the points are wrong."""
    depth = np.where(np.arange(200) < 100, 3.0, behind_it())
    both = outlined(seen_mask((100, 140)), depth)
    assert both.occluded < 0.02
    assert both.overlap == pytest.approx(0.5, abs=0.05)


def test_an_object_behind_the_camera_is_hidden_whole():
    behind = replace(BOARD, xyz=BOARD.xyz - [0, 0, 4])
    nothing = outlined(np.zeros((160, 200), bool), 3.0, points=behind)
    assert nothing.occluded == 1.0
    assert np.isnan(nothing.overlap)
    assert outlined(seen_mask(), 3.0, points=behind).overlap == 0.0


def test_no_points_are_hidden_whole():
    assert outlined(seen_mask(), 3.0, points=cloud(np.zeros((0, 3)))).occluded == 1.0


def test_a_world_twice_as_large_gives_the_same():
    mask, depth = seen_mask((100, 140)), np.where(np.arange(200) < 100, 1.0, behind_it())
    here = outlined(mask, depth)
    large = moved(BOARD, scale=2.0, yaw=0.0, shift=(0, 0, 0))
    there = outlined(mask, 2 * depth, points=large)
    assert there.occluded == pytest.approx(here.occluded)
    assert there.overlap == pytest.approx(here.overlap)
