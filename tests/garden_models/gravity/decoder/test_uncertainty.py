"""Calibration: whatever a network claims, what comes out covers what it says it covers."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.gravity.decoder.familiarity import learn_familiarity
from garden_models.gravity.decoder.uncertainty import calibrate, coverage


def scenes(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return claims that are wrong by a power and a factor, and the errors behind them."""
    rng = np.random.default_rng(seed)
    sigma = np.exp(rng.uniform(np.log(0.005), np.log(0.2), count))
    error = sigma * np.sqrt(rng.exponential(1.0, count))
    return 0.3 * sigma**0.6, error


@pytest.mark.parametrize("share", [0.5, 0.8, 0.9, 0.95])
def test_held_out_errors_lie_within_the_radii_that_should_hold_them(share):
    calibration = calibrate(*scenes(800, 0))
    claimed, error = scenes(2000, 1)
    sigma = np.array([calibration.sigma(c) for c in claimed])
    assert coverage(sigma, error, share) == pytest.approx(share, abs=0.05)


def test_each_half_is_covered_the_sure_and_the_unsure():
    calibration = calibrate(*scenes(800, 0))
    claimed, error = scenes(2000, 1)
    sigma = np.array([calibration.sigma(c) for c in claimed])
    sure = claimed < np.median(claimed)
    for half in (sure, ~sure):
        assert coverage(sigma[half], error[half], 0.8) == pytest.approx(0.8, abs=0.07)


def test_a_surer_claim_never_means_less():
    calibration = calibrate(*scenes(200, 2))
    sigmas = [calibration.sigma(c) for c in np.geomspace(1e-4, 2, 200)]
    assert np.all(np.diff(sigmas) >= 0)


def test_answers_that_are_wildly_wrong_are_counted_apart():
    claimed, error = scenes(1000, 3)
    wrong = np.random.default_rng(4).uniform(size=1000) < 0.1
    error = np.where(wrong, 1.5, error)
    calibration = calibrate(claimed, error)
    assert calibration.spoilt == pytest.approx(0.1, abs=0.04)


def test_too_few_scenes_are_refused():
    with pytest.raises(ValueError, match="too few"):
        calibrate(np.ones(5), np.ones(5))


def test_what_was_learned_from_is_familiar_and_something_else_is_not():
    rng = np.random.default_rng(0)
    known = [rng.normal(0, [1.0, 0.2, 3.0], (4, 3)) for _ in range(200)]
    familiarity = learn_familiarity(known)
    assert max(familiarity.strangeness(tokens) for tokens in known) <= 1
    assert familiarity.strangeness(known[0] * 1000) > 1.5
