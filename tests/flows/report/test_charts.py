"""Charts: round ticks, labels inside of the picture, no drama about nothing."""

from __future__ import annotations

import re

import numpy as np
import pytest

from flows.report.charts import WIDTH, Line, bounded, line_chart, round_ticks

TIMES = np.linspace(0, 10, 1001)


def heights(svg: str) -> list[float]:
    """Return the y of the curve's points."""
    points = re.search(r'polyline points="([^"]+)"', svg)
    assert points
    return [float(pair.split(",")[1]) for pair in points[1].split()]


@pytest.mark.parametrize(
    ("top", "ticks"),
    [
        (1.0, [0, 0.5, 1]),
        (1.36, [0, 1, 2]),
        (0.00912, [0, 0.005, 0.01]),
        (47.0, [0, 10, 20, 30, 40, 50]),
        (2400.0, [0, 1000, 2000, 3000]),
    ],
)
def test_ticks_are_round(top: float, ticks: list[float]) -> None:
    assert round_ticks(top) == ticks


def test_a_hundredth_of_a_millimetre_is_no_earthquake() -> None:
    svg = line_chart(TIMES, Line("moved", "mm", np.minimum(TIMES, 1) * 0.01, "#000", 1.0))
    assert ">1 mm<" in svg
    ys = heights(svg)
    assert max(ys) - min(ys) <= 2
    still = line_chart(TIMES, Line("moved", "mm", np.minimum(TIMES, 1) * 0.005, "#000", 1.0))
    assert "moved less than 0.01 mm" in still


def test_large_motion_fills_the_chart_and_labels_fit() -> None:
    svg = line_chart(TIMES, Line("moved", "mm", TIMES * 12_000, "#000", 1.0))
    assert "at most 1.2e+05 mm" in svg
    ys = heights(svg)
    assert max(ys) - min(ys) > 60
    for x, anchor, text in re.findall(
        r'<text x="([\d.]+)" y="[\d.]+" text-anchor="(\w+)">([^<]+)', svg
    ):
        width = 6.2 * len(text)
        left = float(x) - {"end": width, "middle": width / 2, "start": 0}[anchor]
        assert left >= 0
        assert left + width <= WIDTH


def test_numbers_that_are_none_are_left_out() -> None:
    values = np.where(TIMES > 5, np.nan, TIMES)
    svg = line_chart(TIMES, Line("tilted", "°", values, "#000", 1.0))
    assert "nan" not in svg
    assert "at most 5°" in svg


def test_bounded() -> None:
    assert bounded(0.0, 0.01) == "less than 0.01"
    assert bounded(3.14159, 0.01) == "at most 3.14"
