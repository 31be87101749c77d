"""A box drawn on a photo file, found again in the undistorted working picture."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from garden_models.scene import BadInput, Reconstruction, Scale, Target, View
from garden_models.segmentation.box import ViewBox, box_in_view, undistorted_box
from tests.garden_models.segmentation.clouds import cloud

K = np.array([[220.0, 0, 98], [0, 215.0, 77], [0, 0, 1]])
BENT = np.array([-0.2, 0.05, 0.002, -0.001])


def view(distortion=(0, 0, 0, 0), photo="a.jpg"):
    return View(
        photo,
        np.zeros((150, 200, 3), np.uint8),
        np.ones((150, 200)),
        np.ones((150, 200)),
        K,
        np.eye(4)[:3],
        (1000, 600),
        np.array(distortion, float),
    )


def reconstruction(unregistered=()):
    points = cloud(np.zeros((1, 3)))
    return Reconstruction(
        (view(photo="a.jpg"), view(photo="b.jpg")), points, points.xyz, unregistered, Scale("prior")
    )


def test_a_box_scales_from_the_file_to_the_working_size():
    low, high = undistorted_box((100, 120, 500, 240), view())
    np.testing.assert_allclose(low, [20, 30])
    np.testing.assert_allclose(high, [100, 60])


def test_a_box_past_the_border_is_clipped_to_the_picture():
    low, high = undistorted_box((-50, -50, 9000, 300), view())
    np.testing.assert_allclose(low, [0, 0])
    np.testing.assert_allclose(high, [200, 75])


def bent_pixels(pixels):
    """Where a lens shows what the undistorted picture shows at ``pixels``."""
    rays = np.column_stack([(pixels - K[:2, 2]) / K[[0, 1], [0, 1]], np.ones(len(pixels))])
    return cv2.projectPoints(rays, np.zeros(3), np.zeros(3), K, BENT)[0][:, 0]


@pytest.mark.parametrize("corner", [(10, 10), (60, 40), (120, 80)])
def test_what_was_in_the_box_on_the_photo_is_in_the_box_of_the_view(corner):
    """The lens is inverted: a thing's outline, bent, boxed and undistorted, is boxed again."""
    t = np.linspace(0, 2 * np.pi, 100)
    outline = np.array(corner) + 30 + 25 * np.column_stack([np.cos(t), np.sin(t)])
    bent = [5, 4] * bent_pixels(outline)
    low, high = undistorted_box((*bent.min(0), *bent.max(0)), view(BENT))
    assert (low <= outline.min(0) + 0.2).all()
    assert (high >= outline.max(0) - 0.2).all()
    assert (np.abs(low - outline.min(0)) < 5).all()
    assert (np.abs(high - outline.max(0)) < 5).all()


def test_a_box_is_found_in_the_view_of_its_photo():
    box = box_in_view(Target("cup", "b.jpg", (100, 120, 500, 240)), reconstruction())
    assert box.view == 1
    np.testing.assert_allclose(box.size, [80, 30])


@pytest.mark.parametrize(
    ("photo", "says"),
    [("lost.jpg", "could not be registered"), ("typo.jpg", "is not in the capture")],
)
def test_a_box_on_a_photo_without_a_view_is_refused_with_a_way_out(photo, says):
    with pytest.raises(BadInput, match=says) as problem:
        box_in_view(Target("cup", photo, (0, 0, 9, 9)), reconstruction(("lost.jpg",)))
    assert "'cup'" in str(problem.value)
    assert "'a.jpg'" in str(problem.value)


@pytest.mark.parametrize("box", [(80, 80, 84, 300), (1100, 10, 1150, 90), (np.nan,) * 4])
def test_a_box_without_area_in_the_picture_is_refused(box):
    with pytest.raises(BadInput, match="larger box, inside the photo"):
        box_in_view(Target("cup", "a.jpg", box), reconstruction())


BOX = ViewBox(0, np.array([20.0, 30.0]), np.array([100.0, 60.0]), (200, 150))


def test_relative_pixels_are_0_in_the_middle_and_1_on_the_border():
    pixels = np.array([[60, 45], [100, 45], [20, 60], [140, 45]])
    np.testing.assert_allclose(BOX.relative(pixels), [[0, 0], [1, 0], [-1, 1], [2, 0]])


def test_a_margin_grows_the_box_by_shares_of_its_half():
    pixels = np.array([[100.0, 60.0], [103.9, 60.0], [104.1, 60.0], [np.nan, np.nan]])
    assert BOX.contains(pixels).tolist() == [True, False, False, False]
    assert BOX.contains(pixels, 0.1).tolist() == [True, True, False, False]


def test_a_side_on_the_pictures_border_is_open_to_what_the_picture_cuts():
    box = ViewBox(0, np.array([0.0, 30.0]), np.array([100.0, 60.0]), (200, 150))
    beyond = np.array([[-40.0, 45.0], [-140.0, 45.0], [140.0, 45.0], [50.0, 15.0]])
    np.testing.assert_array_equal(box.contains(beyond), [True, False, False, False])


def test_a_grown_box_stays_in_the_picture():
    box = ViewBox(0, np.array([1.0, 30.0]), np.array([101.0, 60.0]), (200, 150)).grown(0.1)
    np.testing.assert_allclose(box.low, [0, 28.5])
    np.testing.assert_allclose(box.high, [106, 61.5])
