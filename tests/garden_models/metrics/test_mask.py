from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from garden_models.metrics.mask import (
    boundary,
    boundary_f,
    intersection_over_union,
    mean_intersection_over_union,
)


def rectangle(x0: int, y0: int, x1: int, y1: int) -> np.ndarray:
    mask = np.zeros((40, 60), bool)
    mask[y0:y1, x0:x1] = True
    return mask


def test_iou_of_known_rectangles() -> None:
    assert intersection_over_union(rectangle(0, 0, 10, 10), rectangle(5, 0, 15, 10)) == 50 / 150
    assert intersection_over_union(rectangle(0, 0, 5, 5), rectangle(10, 10, 15, 15)) == 0.0


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0, 1))
def test_scores_are_symmetric_bounded_and_one_for_equal(seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.random((2, 12, 17)) < share
    for score in (intersection_over_union, boundary_f):
        assert score(a, a) == 1.0
        assert score(a, b) == pytest.approx(score(b, a))
        assert 0.0 <= score(a, b) <= 1.0


def test_boundary_f_forgives_a_shift_within_the_tolerance_only() -> None:
    truth = rectangle(20, 10, 40, 30)
    assert boundary_f(rectangle(22, 10, 42, 30), truth, 2.0) == 1.0
    assert boundary_f(rectangle(26, 16, 46, 36), truth, 1.0) < 0.5
    assert boundary_f(np.zeros_like(truth), truth) == 0.0


def test_the_image_border_is_no_boundary() -> None:
    assert not boundary(np.ones((5, 5), bool)).any()
    assert boundary(rectangle(0, 0, 10, 40))[:, 9].all()


def test_mean_counts_only_views_whose_truth_shows_the_object() -> None:
    full, empty = rectangle(0, 0, 10, 10), rectangle(0, 0, 0, 0)
    assert mean_intersection_over_union((full, full), (full, empty)) == 1.0
    with pytest.raises(ValueError, match="no truth mask"):
        mean_intersection_over_union((full,), (empty,))
    with pytest.raises(ValueError, match="as many"):
        mean_intersection_over_union((full,), (full, full))


def test_different_sizes_are_refused() -> None:
    with pytest.raises(ValueError, match="one size"):
        intersection_over_union(np.ones((2, 2), bool), np.ones((2, 3), bool))
