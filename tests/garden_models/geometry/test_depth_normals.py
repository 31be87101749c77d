"""Normals from depth: exact on a plane, none across a jump, towards the camera."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.geometry.camera import pixel_grid, pixel_rays
from garden_models.geometry.depth_normals import coarse_depth, depth_normals
from garden_models.geometry.rigid import invert_rigid, rigid
from garden_models.geometry.rotation import axis_angle, normalized

K = np.array([[80.0, 0, 50], [0, 80.0, 40], [0, 0, 1]])
CAMERA = rigid(axis_angle(np.array([1.0, 2, 3]), 0.7), np.array([0.1, -0.2, 0.3]))


def plane_depth(normal: np.ndarray, distance: float) -> np.ndarray:
    rays = pixel_rays(pixel_grid(80, 100), K)
    return distance / (rays @ normal)


@pytest.mark.parametrize("long_side", [100, 25])
def test_a_plane_has_its_normal_everywhere(long_side):
    normal = normalized(np.array([0.2, -0.3, 1.0]))
    depth = plane_depth(normal, 2.0)
    points, normals = depth_normals(depth, K, CAMERA, long_side)
    world = -CAMERA[:3, :3].T @ normal
    tolerance = 1e-9 if long_side == 100 else 0.01  # block medians bend a slanted plane a little
    np.testing.assert_allclose(normals, np.tile(world, (len(normals), 1)), atol=tolerance)
    heights = points @ world
    np.testing.assert_allclose(heights, heights.mean(), atol=0.01)
    assert len(points) > 0.8 * (long_side - 2) * (0.8 * long_side - 2)


def test_no_normal_spans_a_jump_or_a_hole():
    depth = np.full((80, 100), 2.0)
    depth[:, 50:] = 4.0
    depth[:10] = 0
    points, normals = depth_normals(depth, K, CAMERA, 100)
    facing = normals @ CAMERA[:3, :3].T
    np.testing.assert_allclose(facing, np.tile([0, 0, -1], (len(facing), 1)), atol=1e-9)
    rows = 80 - 10 - 2
    assert len(points) == rows * (98 - 2)


def test_without_depth_there_are_no_normals():
    points, normals = depth_normals(np.zeros((80, 100)), K, CAMERA, 40)
    assert points.shape == normals.shape == (0, 3)


def test_blocks_take_the_median_of_what_is_there():
    depth = np.zeros((4, 4))
    depth[:2, :2] = [[1, 2], [3, 0]]
    depth[2, 0] = 5
    np.testing.assert_array_equal(coarse_depth(depth, 2), [[2, 0], [0, 0]])


def test_points_lie_where_the_camera_sees_them():
    points, _ = depth_normals(np.full((80, 100), 3.0), K, CAMERA, 50)
    z = (invert_rigid(invert_rigid(CAMERA)) @ np.c_[points, np.ones(len(points))].T)[2]
    np.testing.assert_allclose(z, 3.0)
