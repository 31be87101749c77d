"""Compare pictures: RMSE, PSNR and SSIM on RGB in 0..1.

SSIM is that of Wang et al. 2004: an 11x11 Gaussian window (sigma 1.5), K1 = 0.01,
K2 = 0.03, data range 1, per channel, averaged over the pixels whose window lies in the picture.
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

RGB = UInt8[np.ndarray, "h w 3"] | Float[np.ndarray, "h w 3"]

WINDOW, SIGMA = 11, 1.5
C1, C2 = 0.01**2, 0.03**2


def rmse(a: RGB, b: RGB, mask: Bool[np.ndarray, "h w"] | None = None) -> float:
    """Return the root mean square error over all pixels (or those of the mask) and channels."""
    first, second = _unit_pair(a, b)
    error = (first - second) ** 2
    if mask is not None:
        if not mask.any():
            raise ValueError("the mask holds no pixel to compare")
        error = error[mask]
    return float(np.sqrt(error.mean()))


def psnr(a: RGB, b: RGB, mask: Bool[np.ndarray, "h w"] | None = None) -> float:
    """Return the peak signal-to-noise ratio in dB; infinite for equal pictures."""
    error = rmse(a, b, mask)
    return float("inf") if error == 0 else float(-20 * np.log10(error))


def ssim(a: RGB, b: RGB, mask: Bool[np.ndarray, "h w"] | None = None) -> float:
    """Return the mean structural similarity (1 for equal pictures).

    With a mask, the mean is over its pixels that have a whole window.
    """
    values = ssim_map(a, b)
    if mask is None:
        return float(values.mean())
    border = WINDOW // 2
    inner = mask[border:-border, border:-border]
    if not inner.any():
        raise ValueError("the mask holds no pixel with a whole 11x11 window")
    return float(values[inner].mean())


def ssim_map(a: RGB, b: RGB) -> Float[np.ndarray, "h_minus_10 w_minus_10 3"]:
    """Return the structural similarity of every whole window, per channel."""
    first, second = _unit_pair(a, b)
    if min(first.shape[:2]) < WINDOW:
        raise ValueError(f"SSIM needs pictures of at least 11x11 pixels, got {first.shape[:2]}")
    mean_a, mean_b = _blurred(first), _blurred(second)
    variance_a = _blurred(first * first) - mean_a**2
    variance_b = _blurred(second * second) - mean_b**2
    covariance = _blurred(first * second) - mean_a * mean_b
    likeness = (2 * mean_a * mean_b + C1) * (2 * covariance + C2)
    likeness /= (mean_a**2 + mean_b**2 + C1) * (variance_a + variance_b + C2)
    return np.asarray(likeness)


def _blurred(picture: Float[np.ndarray, "h w 3"]) -> Float[np.ndarray, "hh ww 3"]:
    """Return Gaussian means of the whole windows."""
    blurred = cv2.GaussianBlur(picture, (WINDOW, WINDOW), SIGMA)
    border = WINDOW // 2
    return np.asarray(blurred[border:-border, border:-border])


def _unit_pair(a: RGB, b: RGB) -> tuple[Float[np.ndarray, "h w 3"], Float[np.ndarray, "h w 3"]]:
    """Return both pictures as floats in 0..1. Raises ValueError for different sizes."""
    if a.shape != b.shape or a.ndim != 3 or a.shape[2] != 3:
        raise ValueError(f"pictures must both be (h, w, 3), got {a.shape} and {b.shape}")
    return _unit(a), _unit(b)


def _unit(picture: RGB) -> Float[np.ndarray, "h w 3"]:
    """Return a picture as float in 0..1 (bytes are divided by 255)."""
    scale = 255.0 if picture.dtype == np.uint8 else 1.0
    return np.asarray(picture, np.float64) / scale
