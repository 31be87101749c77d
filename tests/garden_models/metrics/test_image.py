"""Picture metrics against scikit-image."""

from __future__ import annotations

import numpy as np
import pytest
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

from garden_models.metrics.image import psnr, rmse, ssim, ssim_map


@pytest.fixture
def pair():
    rng = np.random.default_rng(0)
    smooth = np.cumsum(rng.normal(0, 3, (40, 60, 3)), axis=1) + 128
    a = np.clip(smooth, 0, 255).astype(np.uint8)
    b = np.clip(smooth + rng.normal(0, 12, smooth.shape), 0, 255).astype(np.uint8)
    return a, b


def test_equals_scikit_image(pair):
    a, b = pair
    assert psnr(a, b) == pytest.approx(peak_signal_noise_ratio(a, b), rel=1e-9)
    expected = structural_similarity(
        a / 255,
        b / 255,
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
        data_range=1,
        channel_axis=-1,
    )
    assert ssim(a, b) == pytest.approx(expected, abs=1e-6)


def test_equal_pictures_and_symmetry(pair):
    a, b = pair
    assert rmse(a, a) == 0
    assert psnr(a, a) == float("inf")
    assert ssim(a, a) == pytest.approx(1)
    assert ssim(a, b) == pytest.approx(ssim(b, a))
    assert rmse(a, b) == pytest.approx(rmse(a / 255, b / 255))
    assert rmse(np.zeros_like(a), np.full_like(a, 255)) == 1


def test_mask_limits_what_counts(pair):
    a, b = pair
    mask = np.zeros(a.shape[:2], bool)
    mask[10:20, 10:30] = True
    changed = a.copy()
    changed[~mask] = 0
    assert rmse(a, changed, mask) == 0
    assert ssim(a, b, mask) == pytest.approx(ssim_map(a, b)[5:15, 5:25].mean())


def test_wrong_input(pair):
    a, b = pair
    with pytest.raises(ValueError, match="must both be"):
        rmse(a, b[:-1])
    with pytest.raises(ValueError, match="no pixel"):
        rmse(a, b, np.zeros(a.shape[:2], bool))
    with pytest.raises(ValueError, match="11x11"):
        ssim(a[:8], b[:8])
