"""The stereo-noise fit gives back what was put in."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from garden_models.disentanglement.training.augmentations.fit_stereo import fit_stereo_noise


def truth() -> np.ndarray:
    """Return a slope from 1 to 3 m with a block before it."""
    depth = np.tile(np.linspace(1, 3, 240)[:, None], (1, 320))
    depth[60:140, 100:180] = 0.9
    return depth


def test_independent_noise_that_grows_is_found():
    rng = np.random.default_rng(0)
    depth = truth()
    relative = depth / np.median(depth)
    noise = rng.normal(0, 1, depth.shape) * (0.003 + 0.004 * (relative - 1))
    fitted = fit_stereo_noise([(depth * (1 + noise), depth)])
    assert fitted.sigma == pytest.approx(0.003, rel=0.1)
    assert fitted.growth == pytest.approx(0.004, rel=0.2)
    assert fitted.correlated < 0.05
    assert fitted.holes == 0


def test_common_noise_is_told_from_independent_noise():
    rng = np.random.default_rng(0)
    depth = truth()
    smooth = gaussian_filter(rng.normal(0, 1, depth.shape), 12)
    smooth *= 0.004 / smooth.std()
    fitted = fit_stereo_noise([(depth * (1 + smooth), depth)])
    assert fitted.correlated > 0.85
    assert fitted.growth < 0.003


def test_holes_and_smeared_edges_are_counted():
    rng = np.random.default_rng(0)
    depth = truth()
    estimate = depth * (1 + rng.normal(0, 0.001, depth.shape))
    estimate[200:224] = 0
    fitted = fit_stereo_noise([(estimate, depth)])
    assert fitted.holes == pytest.approx(24 / 240, rel=0.3)
    assert fitted.smeared == 0
    estimate[60:140, 178:182] = (0.9 + depth[60:140, 190:191]) / 2
    smeared = fit_stereo_noise([(estimate, depth)])
    assert smeared.smeared > 0.05


def test_nothing_to_compare_is_an_error():
    with pytest.raises(ValueError, match="too few"):
        fit_stereo_noise([(np.zeros((40, 40)), np.ones((40, 40)))])
    with pytest.raises(ValueError, match="too few"):
        fit_stereo_noise([])
