"""Which points a camera sees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from garden_models.segmentation.zbuffer import front_points, project_points
from tests.garden_models.segmentation.clouds import cloud

SIZE = (40, 30)
K = np.array([[40.0, 0, 20], [0, 40.0, 15], [0, 0, 1]])
CAMERA = np.eye(4)


def scattered(seed, count=200):
    rng = np.random.default_rng(seed)
    xyz = np.column_stack([rng.uniform(-1, 1, (count, 2)), rng.uniform(-0.5, 3, count)])
    return cloud(xyz, spacing=rng.uniform(0.005, 0.1, count))


def drawn(points, growth=1.0):
    seen = project_points(points.xyz, K, CAMERA, SIZE)
    return front_points(points, seen, K[0, 0], SIZE, growth)


def painted_one_by_one(points, growth):
    """The nearest of all squares over each pixel, by asking each pixel of each square."""
    z = np.full(SIZE[::-1], np.inf)
    for (x, y, depth), spacing in zip(points.xyz, points.spacing, strict=True):
        if depth <= 0:
            continue
        column, row = np.floor(40 * x / depth + 20), np.floor(40 * y / depth + 15)
        if not (0 <= column < SIZE[0] and 0 <= row < SIZE[1]):
            continue
        radius = min(max(np.ceil(0.5 * growth * 40 * spacing / depth - 0.25), 0), 3)
        rows, columns = np.indices(z.shape)
        covered = np.maximum(abs(rows - row), abs(columns - column)) <= radius
        z[covered] = np.minimum(z[covered], depth)
    return z


@pytest.mark.parametrize("growth", [1.0, 1.5])
@pytest.mark.parametrize("seed", range(5))
def test_each_pixel_shows_the_nearest_square_over_it(seed, growth):
    points = scattered(seed)
    front = drawn(points, growth)
    np.testing.assert_array_equal(front.z, painted_one_by_one(points, growth))
    hit = front.index >= 0
    np.testing.assert_array_equal(front.z[hit], points.xyz[front.index[hit], 2])
    assert np.isinf(front.z[~hit]).all()


@pytest.mark.parametrize("seed", range(3))
def test_the_order_of_points_does_not_matter(seed):
    points = scattered(seed)
    order = np.random.default_rng(seed).permutation(len(points))
    front, shuffled = drawn(points), drawn(points.subset(order))
    np.testing.assert_array_equal(front.z, shuffled.z)
    hit = front.index >= 0
    np.testing.assert_array_equal(front.index[hit], order[shuffled.index[hit]])


def test_a_scene_twice_as_large_looks_the_same():
    points = scattered(0)
    large = replace(points, xyz=2 * points.xyz, spacing=2 * points.spacing)
    np.testing.assert_array_equal(drawn(points).index, drawn(large).index)


@pytest.mark.parametrize(("spacing_px", "side"), [(0.4, 1), (2.0, 3), (4.0, 5), (100.0, 7)])
def test_a_point_is_as_wide_as_its_spacing_up_to_seven_pixels(spacing_px, side):
    point = cloud([[0.0, 0.0, 2.0]], spacing=2.0 * spacing_px / 40)
    assert (drawn(point).index == 0).sum() == side**2


def test_points_behind_the_camera_and_beside_the_picture_have_no_pixel():
    xyz = np.array([[0, 0, 1.0], [0, 0, -1.0], [5.0, 0, 1.0], [0, -5.0, 1.0], [0, 0, 0]])
    seen = project_points(xyz, K, CAMERA, SIZE)
    assert (seen.flat >= 0).tolist() == [True, False, False, False, False]
    assert seen.flat[0] == 15 * SIZE[0] + 20
    assert np.isnan(seen.pixels[1]).all()
    np.testing.assert_allclose(seen.pixels[2], [220, 15])


def test_nothing_to_draw_is_an_empty_picture():
    front = drawn(cloud(np.zeros((0, 3))))
    assert (front.index == -1).all()
    assert np.isinf(front.z).all()
