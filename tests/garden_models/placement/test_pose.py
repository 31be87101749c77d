from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from garden_models.geometry.rotation import yaw_gv
from garden_models.metrics.mesh import sample_surface
from garden_models.placement.pose import UprightPose
from garden_models.placement.register import register_to_points
from garden_models.placement.starts import pose_from_points
from tests.garden_models.meshing.staged import block

REAL = st.floats(-3.0, 3.0)


@given(REAL, REAL, REAL, REAL, st.floats(0.1, 5.0))
def test_rays_and_points_use_the_same_pose(
    yaw: float, x: float, y: float, z: float, scale: float
) -> None:
    pose = UprightPose(yaw, np.array([x, y, z]), scale, yaw_gv(0.3))
    rng = np.random.default_rng(0)
    places = rng.normal(size=(5, 3))
    origin = np.zeros((5, 3))
    placed = pose.apply(places)
    start, direction = pose.rays_to_object(origin, placed)
    np.testing.assert_allclose(start + direction, places, atol=1e-8)


def test_a_pose_of_a_matrix_gives_the_matrix_back() -> None:
    matrix = np.eye(4)
    matrix[:3, :3] = 1.7 * yaw_gv(0.8)
    matrix[:3, 3] = [1.0, 2.0, 3.0]
    pose = UprightPose.of(matrix)
    np.testing.assert_allclose(pose.scale * pose.rotation_gv, matrix[:3, :3])
    np.testing.assert_allclose(pose.translation_gv, matrix[:3, 3])


def test_lowering_puts_the_lowest_vertex_on_the_support() -> None:
    vertices = np.asarray(block().vertices)
    pose = UprightPose(0.4, np.array([0.1, 0.2, 0.3]), 1.3, np.eye(3)).lowered_to(0.9, vertices)
    assert pose.apply(vertices)[:, 1].max() == pytest.approx(0.9)


def test_registration_to_points_recovers_a_disturbance() -> None:
    mesh = block()
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    points = sample_surface(vertices, faces, 4000, seed=5)
    start = UprightPose(np.radians(10.0), np.array([0.01, 0.005, -0.01]), 1.04, np.eye(3))
    pose = start
    for _ in range(3):
        pose = register_to_points(vertices, faces, points, pose)
    assert np.degrees(abs(pose.yaw_rad)) < 1.0
    assert pose.scale == pytest.approx(1.0, abs=0.01)
    np.testing.assert_allclose(pose.translation_gv, 0.0, atol=0.003)


def test_a_pose_from_points_fits_their_box() -> None:
    mesh = block()
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    true = UprightPose(0.5, np.array([1.0, 2.0, 3.0]), 2.5, np.eye(3))
    points = true.apply(sample_surface(vertices, faces, 20_000))
    height = float(true.apply(vertices)[:, 1].max())
    found = pose_from_points(vertices, np.eye(3), points, height, 0.5)
    assert found.scale == pytest.approx(2.5, rel=0.03)
    np.testing.assert_allclose(found.translation_gv, true.translation_gv, atol=0.03)
