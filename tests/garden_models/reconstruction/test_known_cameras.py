"""Epipolar errors of given cameras, and the verdict on them."""

from __future__ import annotations

import numpy as np

from garden_models.geometry.rigid import rigid, transform_points
from garden_models.geometry.rotation import axis_angle
from garden_models.reconstruction.known_cameras import (
    CameraTrust,
    epipolar_error,
    judge_agreement,
)


def test_exact_projections_have_no_epipolar_error() -> None:
    rng = np.random.default_rng(0)
    b_from_a = rigid(axis_angle(rng.normal(size=3), 0.4), rng.normal(size=3))
    points_a = rng.normal(size=(50, 3)) + np.array([0, 0, 6])
    points_b = transform_points(b_from_a, points_a)
    a, b = points_a[:, :2] / points_a[:, 2:], points_b[:, :2] / points_b[:, 2:]
    assert epipolar_error(a, b, b_from_a).max() < 1e-9


def test_epipolar_error_is_a_distance() -> None:
    """A sideways step: lines are rows, so a shift of y by d in both photos' difference counts."""
    b_from_a = rigid(np.eye(3), np.array([1.0, 0, 0]))
    a = np.array([[0.1, 0.2]])
    # Sampson's distance splits the shift between both photos.
    assert np.isclose(epipolar_error(a, a + np.array([0.3, 0.01]), b_from_a)[0], 0.01 / np.sqrt(2))


def test_verdicts_follow_the_share() -> None:
    trust = CameraTrust()
    assert judge_agreement(0.95, 1000, trust).status == "ok"
    assert judge_agreement(0.4, 1000, trust).status == "degraded"
    assert judge_agreement(0.05, 1000, trust).status == "failed"
    assert judge_agreement(0.0, 0, trust).status == "failed"
