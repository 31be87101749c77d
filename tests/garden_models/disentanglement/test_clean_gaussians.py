"""The objects' Gaussians leave by their means, the others come to Gravity-View in metres."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from garden_models.disentanglement.clean_gaussians import clean_gaussians, thinned
from garden_models.geometry.rotation import axis_angle, matrix_from_quaternion
from garden_models.reconstruction.geometry_model import (
    Gaussians,
    GeometryPrediction,
    joined_gaussians,
)
from garden_models.scene import (
    BadInput,
    GravityView,
    PointCloud,
    PointLabels,
    Reconstruction,
    Scale,
)

UNIT = 0.5
"""Metres of one unit of the prediction."""


@pytest.fixture
def scene():
    rng = np.random.default_rng(0)
    floor = np.column_stack([rng.uniform(-1, 1, 3000), np.zeros(3000), rng.uniform(-1, 1, 3000)])
    ball = rng.normal(size=(800, 3))
    ball = 0.2 * ball / np.linalg.norm(ball, axis=1, keepdims=True) - [0, 0.25, 0]
    xyz = np.concatenate([floor, ball]).astype(np.float32)
    n = len(xyz)
    points = PointCloud(
        xyz,
        np.zeros((n, 3), np.uint8),
        np.tile(np.float32([0, -1, 0]), (n, 1)),
        np.full(n, 0.03, np.float32),
        np.ones(n, np.float32),
    )
    reconstruction = Reconstruction((), points, np.zeros((0, 3)), (), Scale("unknown", UNIT))
    label = PointLabels("ball", "given", (np.arange(n) >= 3000).astype(np.float32))
    noisy = (xyz + rng.normal(size=xyz.shape) * 0.01) / UNIT
    gaussians = Gaussians(
        noisy.astype(np.float32),
        np.full((n, 3), 0.02 / UNIT, np.float32),
        np.tile(np.float32([1, 0, 0, 0]), (n, 1)),
        np.full(n, 0.9, np.float32),
        np.full((n, 3), 0.5, np.float32),
        np.zeros(n, int),
    )
    gv_from_world = np.eye(4)
    gv_from_world[:3, :3] = axis_angle(np.array([1.0, 0, 0]), 0.4)
    gv_from_world[:3, 3] = (0.1, 0.2, 0.3)
    gravity = GravityView(gv_from_world, "a", gv_from_world[1, :3], 1.0, ())
    return reconstruction, gravity, GeometryPrediction((), False, (), gaussians), (label,)


def test_the_objects_gaussians_leave_and_the_others_stay(scene):
    gravity = scene[1]
    found = clean_gaussians(*scene)
    turned = found.mean - gravity.gv_from_world[:3, 3]
    world = turned @ gravity.gv_from_world[:3, :3]
    on_ball = np.abs(np.linalg.norm(world + np.array([0, 0.25, 0]), axis=1) - 0.2) < 0.05
    floor = np.abs(world[:, 1]) < 0.06
    assert (floor | on_ball).all() and len(world) > 2900
    assert (on_ball & ~floor).sum() < 10
    np.testing.assert_allclose(found.scale, 0.02, rtol=1e-5)
    np.testing.assert_allclose(
        matrix_from_quaternion(found.rotation[0].astype(float)),
        gravity.gv_from_world[:3, :3],
        atol=1e-6,
    )


def test_without_labels_all_stay(scene):
    reconstruction, gravity, prediction, _ = scene
    assert len(clean_gaussians(reconstruction, gravity, prediction, ()).mean) == 3800


def test_what_many_photos_saw_alike_is_thinned_and_still_covers_the_floor(scene):
    cloud = scene[2].gaussians
    many = joined_gaussians([replace(cloud, opacity=cloud.opacity * f) for f in (1, 0.9, 0.8)])
    few = thinned(many, 2000)
    assert 800 < len(few.mean) <= 2000
    assert thinned(many, 20_000) is many
    nearest, _ = cKDTree(few.mean).query(cloud.mean[:3000])
    assert np.quantile(nearest, 0.99) * UNIT < 0.1
    assert few.opacity.min() == pytest.approx(0.9)  # the most opaque stay


def test_what_does_not_belong_together_is_refused(scene):
    reconstruction, gravity, prediction, (label,) = scene
    with pytest.raises(BadInput, match="holds no Gaussians"):
        clean_gaussians(reconstruction, gravity, GeometryPrediction((), False), (label,))
    short = PointLabels("ball", "given", label.probability[:-1])
    with pytest.raises(BadInput, match="label it again"):
        clean_gaussians(reconstruction, gravity, prediction, (short,))
