"""Binary scores from pooled counts."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from garden_models.metrics.classification import Confusion, confusion

COUNTS = st.integers(0, 10**6)


def test_scores_of_a_known_table():
    counts = Confusion(true_positive=6, false_positive=2, false_negative=3, true_negative=9)
    assert counts.precision == pytest.approx(6 / 8)
    assert counts.recall == pytest.approx(6 / 9)
    assert counts.f1 == pytest.approx(12 / 17)
    assert counts.iou == pytest.approx(6 / 11)
    assert counts.accuracy == pytest.approx(15 / 20)


@given(COUNTS, COUNTS, COUNTS, COUNTS)
def test_f1_is_the_harmonic_mean_and_never_below_iou(tp, fp, fn, tn):
    counts = Confusion(tp, fp, fn, tn)
    assert counts.f1 >= counts.iou
    if tp:
        p, r = counts.precision, counts.recall
        assert counts.f1 == pytest.approx(2 * p * r / (p + r))
        assert counts.f1 == pytest.approx(2 * counts.iou / (1 + counts.iou))


def test_counts_add_up_over_parts():
    rng = np.random.default_rng(0)
    claimed, truth = rng.random(1000) < 0.4, rng.random(1000) < 0.5
    parts = [confusion(claimed[k::3], truth[k::3]) for k in range(3)]
    assert parts[0] + parts[1] + parts[2] == confusion(claimed, truth)
    assert confusion(truth, truth).f1 == 1
    assert confusion(~truth, truth).f1 == 0


def test_nothing_to_find_and_nothing_claimed_is_right():
    none = np.zeros(5, bool)
    assert confusion(none, none).f1 == 1
    with pytest.raises(ValueError, match="one shape"):
        confusion(none, np.zeros(4, bool))
