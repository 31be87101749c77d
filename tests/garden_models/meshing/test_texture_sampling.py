from __future__ import annotations

import numpy as np

from garden_models.meshing.texture_sampling import sample_texture


def test_the_origin_is_the_lower_left() -> None:
    picture = np.zeros((2, 2, 3), np.uint8)
    picture[0, 0], picture[0, 1] = [10, 0, 0], [20, 0, 0]
    picture[1, 0], picture[1, 1] = [30, 0, 0], [40, 0, 0]
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    np.testing.assert_array_equal(sample_texture(picture, corners)[:, 0], [30, 40, 10, 20])


def test_between_texels_colours_blend() -> None:
    picture = np.array([[[0] * 3, [100] * 3]], np.uint8)
    found = sample_texture(picture, np.array([[0.25, 0.5], [0.5, 0.5], [0.75, 0.5]]))
    np.testing.assert_array_equal(found[:, 0], [0, 50, 100])


def test_coordinates_wrap_around() -> None:
    picture = np.random.default_rng(0).integers(0, 256, (8, 8, 3), np.uint8)
    uv = np.random.default_rng(1).uniform(0.05, 0.95, (20, 2))
    shifted = uv + np.random.default_rng(2).integers(-2, 3, uv.shape)
    np.testing.assert_array_equal(sample_texture(picture, uv), sample_texture(picture, shifted))
