"""Axes as quadratic forms: poles, girdles, their sums, densities and coverings."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.geometry.direction import (
    add_covariance,
    axis_angle_deg,
    girdle_form,
    hemisphere,
    least_axis,
    log_density,
    pole_form,
    soften,
    total_sigma_deg,
)
from garden_models.geometry.rotation import matrix_from_quaternion, normalized


def random_axes(count: int, seed: int = 0) -> np.ndarray:
    axes = np.random.default_rng(seed).normal(size=(count, 3))
    return axes / np.linalg.norm(axes, axis=1, keepdims=True)


def test_hemisphere_covers_every_axis() -> None:
    grid = hemisphere(2000)
    np.testing.assert_allclose(np.linalg.norm(grid, axis=1), 1)
    nearest = np.abs(random_axes(500) @ grid.T).max(1)
    # 2000 equal cells of the half sphere have a radius of about 1.8 degrees.
    assert np.degrees(np.arccos(nearest)).max() < 3.0


def test_axis_angle_ignores_sign() -> None:
    a, b = random_axes(2)
    assert axis_angle_deg(a, b) == pytest.approx(axis_angle_deg(-a, b))
    assert axis_angle_deg(a, -a) == pytest.approx(0.0, abs=1e-9)
    assert axis_angle_deg(np.eye(3)[0], np.eye(3)[1]) == pytest.approx(90.0)


@pytest.mark.parametrize("seed", range(4))
def test_pole_gives_back_axis_and_sigma(seed: int) -> None:
    (axis,) = random_axes(1, seed)
    found, sigmas, tilts = least_axis(pole_form(axis, 0.02))
    assert axis_angle_deg(found, axis) < 1e-6
    np.testing.assert_allclose(sigmas, 0.02)
    np.testing.assert_allclose(tilts @ axis, 0, atol=1e-12)


def test_two_walls_cross_in_the_vertical() -> None:
    a, b = random_axes(2, 5)
    found, _, _ = least_axis(girdle_form(a, 0.01) + girdle_form(b, 0.02))
    assert axis_angle_deg(found, np.cross(a, b)) < 1e-5


def test_one_wall_leaves_one_tilt_open() -> None:
    axis, sigmas, _ = least_axis(girdle_form(np.array([1.0, 0, 0]), 0.01))
    assert abs(axis[0]) < 1e-9
    assert sigmas[0] == pytest.approx(np.pi / 2)
    assert sigmas[1] == pytest.approx(0.01, rel=1e-3)
    assert total_sigma_deg(girdle_form(axis, 0.01)) == 90.0


def test_independent_observations_add_precision() -> None:
    (axis,) = random_axes(1)
    both = pole_form(axis, 0.03) + pole_form(axis, 0.04)
    np.testing.assert_allclose(least_axis(both)[1], 1 / np.sqrt(0.03**-2 + 0.04**-2))


def test_softening_adds_variances() -> None:
    (axis,) = random_axes(1)
    np.testing.assert_allclose(least_axis(soften(pole_form(axis, 0.03), 0.04))[1], 0.05)


def test_added_covariance_acts_along_its_own_tilt() -> None:
    form = pole_form(np.array([0.0, 0, 1]), 0.03)
    _, sigmas, tilts = least_axis(add_covariance(form, np.diag([0.04**2, 0, 0])))
    np.testing.assert_allclose(sigmas, [0.05, 0.03], rtol=1e-6)
    np.testing.assert_allclose(np.abs(tilts[0]), [1, 0, 0], atol=1e-9)


@pytest.mark.parametrize(
    "precisions", [(0.0, 0.0), (0.5, 3.0), (0.0, 400.0), (50.0, 60.0), (200.0, 3e4)]
)
def test_density_integrates_to_one(precisions: tuple[float, float]) -> None:
    turn = matrix_from_quaternion(np.random.default_rng(1).normal(size=4))
    form = turn @ np.diag([0.0, *precisions]) @ turn.T
    grid = hemisphere(200_000)
    assert np.exp(log_density(form, grid)).mean() == pytest.approx(1.0, rel=0.02)


def test_narrow_pole_has_the_gaussian_density() -> None:
    (axis,) = random_axes(1)
    sigma = 0.01
    # Two poles share the sphere's 4 pi: the peak is 1 / sigma^2 over uniform.
    assert log_density(pole_form(axis, sigma), axis[None])[0] == pytest.approx(
        -2 * np.log(sigma), abs=0.01
    )


def test_samples_of_the_density_scatter_as_sigma_says() -> None:
    form = np.diag([1 / 0.1**2, 1 / 0.05**2, 0.0])
    grid = hemisphere(100_000)
    weight = np.exp(log_density(form, grid))
    error = np.degrees(np.arccos(grid[:, 2]))
    rms = np.sqrt((weight @ error**2) / weight.sum())
    assert rms == pytest.approx(total_sigma_deg(form), rel=0.02)
    assert normalized(grid[np.argmax(weight)])[2] == pytest.approx(1.0, abs=1e-3)
