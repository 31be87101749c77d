from __future__ import annotations

import numpy as np
import pytest

from garden_models.metrics.depth import score_depths, truth_at_view

K = np.array([[80.0, 0, 50], [0, 80, 40], [0, 0, 1]])


def depth_map(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(1, 4, (80, 100))


@pytest.mark.parametrize("scale", [0.3, 1.0, 7.0])
def test_one_scale_for_the_scene_is_free(scale: float) -> None:
    truths = [depth_map(0), depth_map(1)]
    score = score_depths([scale * truth for truth in truths], truths)
    assert score.scale == pytest.approx(1 / scale)
    assert score.median_relative_error == pytest.approx(0, abs=1e-12)
    assert score.valid == score.within_1_percent == 1.0
    assert score.views == 2


def test_a_scale_per_view_is_not() -> None:
    truths = [depth_map(0), depth_map(1), depth_map(2)]
    estimates = [truths[0], truths[1], 1.1 * truths[2]]
    score = score_depths(estimates, truths)
    assert score.within_1_percent == pytest.approx(2 / 3)


def test_shares_are_of_pixels_with_truth() -> None:
    truth = depth_map(0)
    truth[:40] = 0
    estimate = truth.copy()
    estimate[:, :50] = 0
    estimate[truth == 0] = 2.0
    score = score_depths([estimate], [truth])
    assert score.valid == pytest.approx(0.5)
    assert score.within_1_percent == pytest.approx(0.5)


def test_refuses_what_cannot_be_compared() -> None:
    truth = depth_map(0)
    with pytest.raises(ValueError, match="as many"):
        score_depths([truth], [])
    with pytest.raises(ValueError, match="shape"):
        score_depths([truth], [truth[1:]])
    with pytest.raises(ValueError, match="no pixel"):
        score_depths([0 * truth], [truth])


def test_truth_without_distortion_is_a_nearest_resize() -> None:
    truth = depth_map(3)
    same = truth_at_view(truth, K, (100, 80), np.zeros(4))
    np.testing.assert_array_equal(same, truth)
    half_K = np.diag([0.5, 0.5, 1]) @ K
    half = truth_at_view(truth, half_K, (50, 40), np.zeros(4))
    np.testing.assert_array_equal(half, truth[1::2, 1::2])


def test_truth_follows_the_lens() -> None:
    truth = np.tile(np.arange(1.0, 101.0), (80, 1))
    view = truth_at_view(truth, K, (100, 80), np.array([-0.2, 0, 0, 0]))
    radius = 30.5 / 80
    expected = 50 + 30.5 * (1 - 0.2 * radius**2)
    assert view[40, 80] == pytest.approx(np.floor(expected) + 1, abs=1)
    assert abs(view[40, 50] - truth[40, 50]) <= 1
