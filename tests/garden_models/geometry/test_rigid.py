"""Rigid transforms form a group and act on points as such."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.geometry.rigid import homogeneous, invert_rigid, rigid, transform_points
from garden_models.geometry.rotation import matrix_from_quaternion

SEEDS = range(5)


def random_rigid(rng: np.random.Generator) -> np.ndarray:
    return rigid(matrix_from_quaternion(rng.normal(size=4)), rng.normal(size=3))


@pytest.mark.parametrize("seed", SEEDS)
def test_inverse_is_two_sided(seed: int) -> None:
    a = random_rigid(np.random.default_rng(seed))
    np.testing.assert_allclose(a @ invert_rigid(a), np.eye(4), atol=1e-12)
    np.testing.assert_allclose(invert_rigid(a) @ a, np.eye(4), atol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_inverse_agrees_with_matrix_inverse(seed: int) -> None:
    a = random_rigid(np.random.default_rng(seed))
    np.testing.assert_allclose(invert_rigid(a), np.linalg.inv(a), atol=1e-12)
    np.testing.assert_allclose(invert_rigid(a[:3]), np.linalg.inv(a), atol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_composition_acts_one_after_the_other(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b, points = random_rigid(rng), random_rigid(rng), rng.normal(size=(7, 3))
    together = transform_points(a @ b, points)
    np.testing.assert_allclose(together, transform_points(a, transform_points(b, points)))


def test_transform_keeps_batch_shape_and_takes_3x4() -> None:
    rng = np.random.default_rng(0)
    a, points = random_rigid(rng), rng.normal(size=(2, 4, 3))
    assert transform_points(a, points).shape == points.shape
    np.testing.assert_array_equal(transform_points(a[:3], points), transform_points(a, points))


def test_homogeneous_adds_the_last_row() -> None:
    a = random_rigid(np.random.default_rng(1))
    np.testing.assert_array_equal(homogeneous(a[:3]), a)
    np.testing.assert_array_equal(homogeneous(a), a)
