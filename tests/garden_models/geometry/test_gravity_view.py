"""The Gravity-View frame is the paper's, exactly."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from garden_models.geometry.camera import camera_centre
from garden_models.geometry.gravity_view import gv_from_camera, gv_from_world
from garden_models.geometry.rigid import rigid, transform_points
from garden_models.geometry.rotation import axis_angle, matrix_from_quaternion, normalized

DOWN = np.array([0.0, 1.0, 0.0])


def test_level_camera_is_gravity_view() -> None:
    np.testing.assert_allclose(gv_from_camera(DOWN), np.eye(3), atol=1e-15)


@given(st.integers(0, 2**32 - 1))
def test_rows_are_the_papers_formula(seed: int) -> None:
    y = normalized(np.random.default_rng(seed).normal(size=3))
    rotation = gv_from_camera(3 * y)
    view = np.array([0.0, 0.0, 1.0])
    x = normalized(np.cross(y, view))
    np.testing.assert_allclose(rotation, np.stack([x, y, np.cross(x, y)]), atol=1e-12)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    np.testing.assert_allclose(rotation @ y, DOWN, atol=1e-12)
    # The view direction has no sideways part and looks ahead.
    assert (rotation @ view)[0] == pytest.approx(0.0, abs=1e-12)
    assert (rotation @ view)[2] >= 0


@pytest.mark.parametrize("degrees", [-60.0, -10.0, 35.0, 80.0])
def test_pitch_and_roll_are_undone(degrees: float) -> None:
    turn = axis_angle(np.array([1.0, 0, 0]), np.radians(degrees))
    np.testing.assert_allclose(gv_from_camera(turn @ DOWN), turn.T, atol=1e-12)
    roll = axis_angle(np.array([0, 0, 1.0]), np.radians(degrees))
    np.testing.assert_allclose(gv_from_camera(roll @ DOWN), roll.T, atol=1e-12)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("tilt", [0.0, 1e-9])
def test_view_along_gravity_falls_back_to_the_cameras_x(sign: float, tilt: float) -> None:
    rotation = gv_from_camera(np.array([tilt, 0, sign]))
    np.testing.assert_allclose(rotation[0], [1, 0, 0], atol=1e-8)
    np.testing.assert_allclose(rotation[1], [0, 0, sign], atol=1e-8)
    assert np.linalg.det(rotation) == pytest.approx(1.0)


@given(st.integers(0, 2**32 - 1))
def test_world_transform_puts_the_reference_at_the_origin(seed: int) -> None:
    rng = np.random.default_rng(seed)
    camera = rigid(matrix_from_quaternion(rng.normal(size=4)), rng.normal(size=3))[:3]
    down = normalized(rng.normal(size=3))
    transform = gv_from_world(down, camera)
    np.testing.assert_allclose(
        transform_points(transform, camera_centre(camera)), np.zeros(3), atol=1e-12
    )
    np.testing.assert_allclose(transform[:3, :3] @ down, DOWN, atol=1e-12)
    np.testing.assert_allclose(transform[:3, :3] @ transform[:3, :3].T, np.eye(3), atol=1e-12)


@given(st.integers(0, 2**32 - 1))
def test_the_choice_of_world_does_not_matter(seed: int) -> None:
    rng = np.random.default_rng(seed)
    camera = rigid(matrix_from_quaternion(rng.normal(size=4)), rng.normal(size=3))
    other = rigid(matrix_from_quaternion(rng.normal(size=4)), rng.normal(size=3))
    down = normalized(rng.normal(size=3))
    here = gv_from_world(down, camera)
    there = gv_from_world(other[:3, :3] @ down, camera @ np.linalg.inv(other))
    np.testing.assert_allclose(there @ other, here, atol=1e-9)
