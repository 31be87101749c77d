"""A mesh that lies wrongly is laid onto the object's points, and only then."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.disentanglement.network.condition_distance import to_condition
from garden_models.disentanglement.network.realign import LEAST_POINTS, realigned
from garden_models.disentanglement.training.augmentations.config import MeshJitter
from garden_models.disentanglement.training.augmentations.mesh_jitter import jitter_mesh
from garden_models.disentanglement.training.pair import Condition
from garden_models.disentanglement.training.shapes.families import make_shape
from garden_models.disentanglement.triangles import sample_triangles


def placed(family: str) -> tuple[np.ndarray, Condition]:
    """Return points of a shape, and its exact condition."""
    shape = make_shape(family, 3)
    corners = shape.vertices[shape.faces] + [1.0, 0.0, 2.0]
    points, _ = sample_triangles(corners, 600, np.random.default_rng(0))
    samples, on = sample_triangles(corners, 2048, np.random.default_rng(1))
    return points, Condition(samples, on, corners)


@pytest.mark.parametrize("family", ["mug", "chair", "teapot", "toy_car"])
def test_a_jittered_mesh_comes_back_to_the_points(family):
    points, exact = placed(family)
    before, after = [], []
    for seed in range(6):
        unit = min(1.0, exact.size)
        wrong = jitter_mesh(exact, np.random.default_rng(seed), MeshJitter(), unit)
        found = realigned(points, wrong) or wrong
        before.append(np.median(to_condition(points, wrong).distance) / exact.size)
        after.append(np.median(to_condition(points, found).distance) / exact.size)
        np.testing.assert_array_equal(found.on, exact.on)
        corners = found.triangles[found.on]
        inside = np.linalg.norm(corners.mean(axis=1) - found.points, axis=1)
        assert inside.max() < 0.8 * exact.size  # samples went with their triangles
    assert np.median(after) < 0.35 * np.median(before)
    assert np.median(after) < 0.02


def test_a_mesh_that_lies_right_stays():
    points, exact = placed("mug")
    assert realigned(points, exact) is None


def test_few_points_move_nothing():
    points, exact = placed("mug")
    wrong = jitter_mesh(exact, np.random.default_rng(0), MeshJitter(), 0.1)
    assert realigned(points[: LEAST_POINTS - 1], wrong) is None
