"""Umeyama alignment recovers similarities and is the least-squares optimum."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.geometry.rotation import axis_angle, matrix_from_quaternion
from garden_models.geometry.umeyama import umeyama


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("flat", [False, True])
def test_exact_similarity_is_recovered(seed: int, flat: bool) -> None:
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(9, 3)) * [1, 1, 0 if flat else 1]
    rotation, translation = matrix_from_quaternion(rng.normal(size=4)), rng.normal(size=3)
    scale = rng.uniform(0.2, 5)
    found = umeyama(a, scale * a @ rotation.T + translation)
    assert found[0] == pytest.approx(scale)
    np.testing.assert_allclose(found[1], rotation, atol=1e-9)
    np.testing.assert_allclose(found[2], translation, atol=1e-9)


def test_mirrored_points_still_give_a_rotation() -> None:
    a = np.random.default_rng(0).normal(size=(20, 3))
    _, rotation, _ = umeyama(a, a * [1, 1, -1])
    assert np.linalg.det(rotation) == pytest.approx(1.0)


def test_without_scale_the_scale_is_one() -> None:
    a = np.random.default_rng(0).normal(size=(20, 3))
    scale, rotation, _ = umeyama(a, 3 * a, with_scale=False)
    assert scale == 1.0
    np.testing.assert_allclose(rotation, np.eye(3), atol=1e-12)


def test_no_small_change_fits_noisy_points_better() -> None:
    rng = np.random.default_rng(3)
    a = rng.normal(size=(30, 3))
    b = 1.7 * a @ matrix_from_quaternion(rng.normal(size=4)).T + 0.2 + rng.normal(0, 0.1, (30, 3))
    scale, rotation, translation = umeyama(a, b)

    def error(s: float, r: np.ndarray, t: np.ndarray) -> float:
        return float(((s * a @ r.T + t - b) ** 2).sum())

    best = error(scale, rotation, translation)
    for axis in np.eye(3):
        for step in (-1e-3, 1e-3):
            assert error(scale * (1 + step), rotation, translation) > best
            assert error(scale, axis_angle(axis, step) @ rotation, translation) > best
            assert error(scale, rotation, translation + step * axis) > best


def test_bad_input_is_refused() -> None:
    a = np.random.default_rng(0).normal(size=(5, 3))
    with pytest.raises(ValueError, match="3 or more"):
        umeyama(a[:2], a[:2])
    with pytest.raises(ValueError, match="got 5 and 4"):
        umeyama(a, a[:4])
    with pytest.raises(ValueError, match="coincide"):
        umeyama(np.ones((5, 3)), a)
