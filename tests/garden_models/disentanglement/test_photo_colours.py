"""Places are looked up in the photos: colour, emptiness, and what blocks the view."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from garden_models.disentanglement.photo_colours import PhotoView, look_up

K = np.array([[100.0, 0, 50], [0, 100.0, 40], [0, 0, 1]])
PLACE = np.array([[0.0, 0.0, 2.0]])


def photo(rgb=(10, 200, 30), depth=2.0, covered=False):
    shape = (80, 100)
    return PhotoView(
        K,
        np.eye(4),
        np.tile(np.uint8(rgb), (*shape, 1)),
        np.full(shape, float(depth)),
        np.full(shape, covered),
    )


def test_a_photo_whose_depth_agrees_gives_the_colour():
    seen = look_up(PLACE, 0.01, (photo(), photo((200, 0, 0), depth=1.0)))
    np.testing.assert_allclose(seen.rgb[0], [10, 200, 30])
    assert not seen.empty[0]
    assert seen.blocked[0] == 0


def test_photos_without_depth_must_agree():
    same = look_up(PLACE, 0.01, (photo(depth=0), photo(depth=0)))
    np.testing.assert_allclose(same.rgb[0], [10, 200, 30])
    differ = look_up(PLACE, 0.01, (photo(depth=0), photo((250, 0, 250), depth=0)))
    assert np.isnan(differ.rgb).all()
    alone = look_up(PLACE, 0.01, (photo(depth=0),))
    assert np.isnan(alone.rgb).all()


def test_an_object_blocks_the_view_and_gives_no_colour():
    seen = look_up(PLACE, 0.01, (photo(covered=True), photo(covered=True, depth=1.5), photo()))
    np.testing.assert_allclose(seen.rgb[0], [10, 200, 30])
    np.testing.assert_allclose(seen.blocked[0], 2 / 3)
    hidden = look_up(PLACE, 0.01, (photo(covered=True),))
    assert np.isnan(hidden.rgb).all()


def test_what_photos_look_through_is_empty():
    assert look_up(PLACE, 0.01, (photo(depth=3.0), photo(depth=3.5), photo(depth=1.0))).empty[0]
    assert not look_up(PLACE, 0.01, (photo(depth=3.0), photo(), photo())).empty[0]


def test_out_of_every_picture_is_unknown():
    behind = replace(photo(), camera_from_gv=np.diag([1.0, 1, -1, 1]))
    seen = look_up(PLACE, 0.01, (behind,))
    assert np.isnan(seen.rgb).all()
    assert not seen.empty[0]
    assert seen.blocked[0] == 0
    assert look_up(np.zeros((0, 3)), 0.01, (photo(),)).rgb.shape == (0, 3)
