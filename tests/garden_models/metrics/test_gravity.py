"""Gravity scores: angles, percentiles, failures, missing answers, the table."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.geometry.rotation import axis_angle
from garden_models.metrics.gravity import (
    GravityTruth,
    MethodErrors,
    angular_error_deg,
    gravity_table,
    score_methods,
)
from garden_models.scene import GravityEvidence, PointCloud, Reconstruction, Scale

DOWN = np.array([0.0, 1.0, 0.0])


def scene(name: str) -> GravityTruth:
    nothing = np.zeros((0, 3))
    cloud = PointCloud(nothing, nothing.astype(np.uint8), nothing, np.zeros(0), np.zeros(0))
    return GravityTruth(name, Reconstruction((), cloud, nothing, (), Scale("unknown")), DOWN)


def answer(degrees: float):
    down = axis_angle(np.array([1.0, 0, 0]), np.radians(degrees)) @ DOWN
    return lambda _: GravityEvidence("made up", down, 2.0, True)


def test_up_for_down_is_180() -> None:
    assert angular_error_deg(DOWN, -DOWN) == pytest.approx(180.0)
    assert angular_error_deg(DOWN, 3 * DOWN) == pytest.approx(0.0)


def test_scores_and_missing_answers() -> None:
    truths = [scene("a"), scene("b")]
    good, none = score_methods(truths, {"good": answer(3), "none": lambda _: None})
    np.testing.assert_allclose(good.errors_deg, [3, 3])
    assert good.calibration == pytest.approx(1.5)
    assert good.failure_rate() == 0.0
    assert good.failure_rate(2.0) == 1.0
    np.testing.assert_array_equal(none.errors_deg, [90, 90])
    assert none.failure_rate() == 1.0
    assert np.isnan(none.calibration)


def test_summary_numbers() -> None:
    errors = np.array([1.0, 2.0, 3.0, 4.0, 30.0])
    row = MethodErrors("m", tuple("abcde"), errors, np.ones(5))
    assert row.mean_deg == pytest.approx(8.0)
    assert row.p90_deg == pytest.approx(19.6)
    assert row.failure_rate() == pytest.approx(0.2)


def test_table_has_a_row_a_method_and_lines_up() -> None:
    scored = score_methods([scene("a"), scene("long name")], {"x": answer(1), "yy": answer(20)})
    lines = gravity_table(scored).splitlines()
    assert len(lines) == 3
    assert len({len(line) for line in lines}) == 1
    assert "long name" in lines[0]
    assert "100%" in lines[2]


def test_no_scene_is_refused() -> None:
    with pytest.raises(ValueError, match="no scene"):
        score_methods([], {"x": answer(1)})
