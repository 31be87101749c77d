"""Pinhole cameras: projection and lifting undo each other; conventions hold."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.geometry.camera import (
    backproject_depth,
    camera_centre,
    inside_image,
    pixel_grid,
    pixel_rays,
    project,
    resize_intrinsics,
)
from garden_models.geometry.rigid import rigid
from garden_models.geometry.rotation import matrix_from_quaternion

K = np.array([[400.0, 0, 33.0], [0, 410.0, 21.5], [0, 0, 1]])


def camera(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rigid(matrix_from_quaternion(rng.normal(size=4)), rng.normal(size=3))[:3]


def test_pixel_centres_are_at_a_half() -> None:
    grid = pixel_grid(3, 5)
    assert grid.shape == (3, 5, 2)
    np.testing.assert_array_equal(grid[0, 0], [0.5, 0.5])
    np.testing.assert_array_equal(grid[2, 4], [4.5, 2.5])


@pytest.mark.parametrize("seed", range(4))
def test_lifting_a_depth_map_and_projecting_returns_the_pixels(seed: int) -> None:
    depth = np.random.default_rng(seed).uniform(0.5, 4, size=(6, 8))
    points = backproject_depth(depth, K, camera(seed))
    pixels, z = project(points.reshape(-1, 3), K, camera(seed))
    np.testing.assert_allclose(pixels, pixel_grid(6, 8).reshape(-1, 2), atol=1e-9)
    np.testing.assert_allclose(z, depth.ravel())


def test_points_behind_have_no_pixel() -> None:
    points = np.array([[0, 0, 1.0], [0, 0, -1.0], [0.2, 0, 0]])
    pixels, z = project(points, K, np.eye(4))
    np.testing.assert_allclose(pixels[0], K[:2, 2])
    assert np.isnan(pixels[1:]).all()
    np.testing.assert_array_equal(z, points[:, 2])
    np.testing.assert_array_equal(inside_image(pixels, (66, 43)), [True, False, False])


def test_image_borders() -> None:
    pixels = np.array([[0.0, 0.0], [63.99, 47.99], [64.0, 10.0], [10.0, -0.01]])
    np.testing.assert_array_equal(inside_image(pixels, (64, 48)), [True, True, False, False])


@pytest.mark.parametrize("seed", range(4))
def test_centre_projects_to_depth_zero(seed: int) -> None:
    _, z = project(camera_centre(camera(seed))[None], K, camera(seed))
    assert z[0] == pytest.approx(0.0, abs=1e-12)


def test_rays_have_unit_z() -> None:
    rays = pixel_rays(pixel_grid(4, 4), K)
    np.testing.assert_array_equal(rays[..., 2], 1.0)


def test_resized_intrinsics_scale_pixels() -> None:
    points = np.random.default_rng(0).uniform([-1, -1, 2], [1, 1, 4], size=(9, 3))
    full, _ = project(points, K, np.eye(4))
    half, _ = project(points, resize_intrinsics(K, (64, 48), (32, 16)), np.eye(4))
    np.testing.assert_allclose(half, full * [0.5, 1 / 3])
