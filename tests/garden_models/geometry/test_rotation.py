"""Rotations: group axioms, round trips between forms, agreement with scipy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from garden_models.geometry.rotation import (
    angle_between_deg,
    axis_angle,
    matrix_from_6d,
    matrix_from_quaternion,
    normalized,
    quaternion_from_matrix,
    rotation_angle_deg,
    rotation_between,
    yaw_gv,
)

seeds = st.integers(0, 2**32 - 1)


def random_rotation(seed: int) -> np.ndarray:
    return matrix_from_quaternion(np.random.default_rng(seed).normal(size=4))


def assert_rotation(matrix: np.ndarray) -> None:
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(matrix) == pytest.approx(1.0)


@given(seeds, seeds, seeds)
def test_group_axioms(s: int, t: int, u: int) -> None:
    a, b, c = random_rotation(s), random_rotation(t), random_rotation(u)
    assert_rotation(a @ b)
    np.testing.assert_allclose((a @ b) @ c, a @ (b @ c), atol=1e-12)
    np.testing.assert_allclose(a @ a.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(a @ np.eye(3), a)


@given(seeds)
def test_quaternion_round_trip(seed: int) -> None:
    wxyz = normalized(np.random.default_rng(seed).normal(size=4))
    wxyz = wxyz if wxyz[0] >= 0 else -wxyz
    back = quaternion_from_matrix(matrix_from_quaternion(wxyz))
    np.testing.assert_allclose(back, wxyz, atol=1e-9)


@given(seeds)
def test_quaternion_agrees_with_scipy(seed: int) -> None:
    wxyz = np.random.default_rng(seed).normal(size=4)
    expected = Rotation.from_quat(wxyz, scalar_first=True).as_matrix()
    np.testing.assert_allclose(matrix_from_quaternion(wxyz), expected, atol=1e-12)


@pytest.mark.parametrize("axis", np.eye(3))
@pytest.mark.parametrize("angle", [np.pi, np.pi - 1e-9, -np.pi / 2, 1e-9])
def test_quaternion_of_half_turns(axis: np.ndarray, angle: float) -> None:
    matrix = axis_angle(axis, angle)
    np.testing.assert_allclose(
        matrix_from_quaternion(quaternion_from_matrix(matrix)), matrix, atol=1e-9
    )


@given(seeds, st.floats(-3.1, 3.1))
def test_axis_angle_agrees_with_scipy(seed: int, angle: float) -> None:
    axis = normalized(np.random.default_rng(seed).normal(size=3))
    expected = Rotation.from_rotvec(axis * angle).as_matrix()
    np.testing.assert_allclose(axis_angle(axis, angle), expected, atol=1e-12)
    assert rotation_angle_deg(axis_angle(axis, angle)) == pytest.approx(
        abs(np.degrees(angle)), abs=1e-6
    )


@given(seeds)
def test_6d_is_left_alone_by_a_second_pass(seed: int) -> None:
    matrix = matrix_from_6d(np.random.default_rng(seed).normal(size=6))
    assert_rotation(matrix)
    np.testing.assert_allclose(matrix_from_6d(matrix[:2].ravel()), matrix, atol=1e-9)


@given(seeds)
def test_6d_holds_the_first_two_rows_of_a_rotation(seed: int) -> None:
    matrix = random_rotation(seed)
    np.testing.assert_allclose(matrix_from_6d(matrix[:2].ravel()), matrix, atol=1e-12)


@given(seeds)
def test_rotation_between_turns_and_is_smallest(seed: int) -> None:
    a, b = np.random.default_rng(seed).normal(size=(2, 3))
    turn = rotation_between(a, b)
    assert_rotation(turn)
    np.testing.assert_allclose(turn @ normalized(a), normalized(b), atol=1e-9)
    assert rotation_angle_deg(turn) == pytest.approx(angle_between_deg(a, b), abs=1e-5)


@pytest.mark.parametrize("a", np.vstack([np.eye(3), [[1, 2, 3]]]))
def test_rotation_between_same_and_opposite(a: np.ndarray) -> None:
    np.testing.assert_allclose(rotation_between(a, 2 * a), np.eye(3))
    half = rotation_between(a, -a)
    assert_rotation(half)
    np.testing.assert_allclose(half @ a, -a, atol=1e-12)


def test_yaw_keeps_gravity() -> None:
    np.testing.assert_allclose(yaw_gv(0.7) @ [0, 1, 0], [0, 1, 0], atol=1e-15)


@pytest.mark.parametrize("angle", [0.0, 1e-7, 30.0, 90.0, 180.0 - 1e-6, 180.0])
def test_angle_between_is_exact_at_both_ends(angle: float) -> None:
    a = np.array([1.0, 0, 0])
    b = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle)), 0])
    assert angle_between_deg(a, 5 * b) == pytest.approx(angle, abs=1e-9)


def test_zero_vector_is_refused() -> None:
    with pytest.raises(ValueError, match="length zero"):
        normalized(np.zeros(3))
