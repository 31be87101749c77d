"""Dominant planes: exact fits, recovery among clutter, agreement with plain least squares."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.geometry.direction import axis_angle_deg
from garden_models.geometry.plane import find_planes, fit_plane, local_normals
from garden_models.geometry.rotation import matrix_from_quaternion
from tests.open3d_library import open3d


def patch(rng: np.random.Generator, count: int, size: tuple[float, float]) -> np.ndarray:
    return np.column_stack([rng.uniform(-1, 1, (count, 2)) * size, np.zeros(count)])


def three_planes(seed: int) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """Return noisy points and normals of three patches and clutter, and the true normals."""
    rng = np.random.default_rng(seed)
    points, normals, truth = [], [], []
    for count in (3000, 2000, 1000):
        turn = matrix_from_quaternion(rng.normal(size=4))
        flat = patch(rng, count, (1.0, 0.7)) + np.array([0, 0, 0.5])
        points.append((flat + [0, 0, 1] * rng.normal(0, 0.004, (count, 1))) @ turn.T)
        normals.append(np.tile(turn[:, 2], (count, 1)))
        truth.append(turn[:, 2])
    points.append(rng.uniform(-1.5, 1.5, (1500, 3)))
    normals.append(rng.normal(size=(1500, 3)))
    all_normals = np.concatenate(normals) + rng.normal(0, 0.15, (7500, 3))
    all_normals /= np.linalg.norm(all_normals, axis=1, keepdims=True)
    return np.concatenate(points), all_normals, truth


@pytest.mark.parametrize("seed", range(5))
def test_planes_are_found_heaviest_first(seed: int) -> None:
    points, normals, truth = three_planes(seed)
    planes = find_planes(points, normals, 0.015)
    assert len(planes) >= 3
    for plane, normal, share in zip(planes, truth, (0.4, 0.27, 0.13), strict=False):
        assert axis_angle_deg(plane.normal, normal) < 0.5
        assert abs(abs(plane.offset) - 0.5) < 0.005
        assert plane.share == pytest.approx(share, abs=0.05)
        np.testing.assert_allclose(plane.extent, [1 / np.sqrt(3), 0.7 / np.sqrt(3)], atol=0.05)
        assert plane.thickness == pytest.approx(0.004, abs=0.002)


def test_inliers_belong_to_one_plane_only_and_are_near_it() -> None:
    points, normals, _ = three_planes(0)
    planes = find_planes(points, normals, 0.015)
    every = np.concatenate([plane.inliers for plane in planes])
    assert len(every) == len(set(every.tolist()))
    for plane in planes:
        assert np.abs(plane.heights(points[plane.inliers])).max() < 0.03


def test_same_seed_same_bits() -> None:
    points, normals, _ = three_planes(1)
    first, second = (find_planes(points, normals, 0.015, seed=4) for _ in range(2))
    assert [p.offset for p in first] == [p.offset for p in second]
    np.testing.assert_array_equal(first[0].inliers, second[0].inliers)


def test_fit_agrees_with_least_squares() -> None:
    rng = np.random.default_rng(2)
    points = patch(rng, 200, (2, 1)) + rng.normal(0, 0.01, (200, 3))
    plane = fit_plane(points, np.ones(200), np.arange(200))
    # z = a x + b y + c by ordinary least squares; the same for so flat a patch.
    a, b, c = np.linalg.lstsq(
        np.column_stack([points[:, :2], np.ones(200)]), points[:, 2], rcond=None
    )[0]
    assert axis_angle_deg(plane.normal, np.array([-a, -b, 1.0])) < 0.01
    assert plane.heights(np.array([[0, 0, c]]))[0] == pytest.approx(0.0, abs=1e-4)
    assert abs(plane.spread[0] @ np.array([1.0, 0, 0])) > 0.99


def test_weights_decide_which_plane_is_heaviest() -> None:
    rng = np.random.default_rng(0)
    floor = patch(rng, 900, (1, 1))
    wall = patch(rng, 300, (1, 1))[:, [2, 0, 1]] + [1.0, 0, 1.2]
    points = np.concatenate([floor, wall])
    normals = np.concatenate([np.tile([0, 0, 1.0], (900, 1)), np.tile([1.0, 0, 0], (300, 1))])
    weights = np.concatenate([np.ones(900), np.full(300, 10.0)])
    assert axis_angle_deg(find_planes(points, normals, 0.01)[0].normal, np.eye(3)[2]) < 1e-6
    heaviest = find_planes(points, normals, 0.01, weights=weights)[0]
    assert axis_angle_deg(heaviest.normal, np.eye(3)[0]) < 1e-6


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_points_give_no_plane(count: int) -> None:
    assert find_planes(np.zeros((count, 3)), np.tile([0, 0, 1.0], (count, 1)), 0.01) == []


def test_clutter_gives_no_plane() -> None:
    rng = np.random.default_rng(0)
    normals = rng.normal(size=(4000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    assert find_planes(rng.uniform(-1, 1, (4000, 3)), normals, 0.01, min_share=0.05) == []


def test_local_normals_of_a_plane() -> None:
    points = patch(np.random.default_rng(0), 500, (1, 1))
    assert np.abs(local_normals(points)[:, 2]).min() > 0.999


def test_normals_equal_open3ds() -> None:
    rng = np.random.default_rng(3)
    x, y = rng.uniform(-1, 1, (2, 3000))
    points = np.column_stack([x, y, 0.3 * np.sin(3 * x) * np.cos(2 * y)])
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
    cloud.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(16))
    cosine = np.einsum("nk,nk->n", local_normals(points, 16), np.asarray(cloud.normals))
    assert np.abs(cosine).min() > 1 - 1e-6
