"""Model what colours the labels have, by smoothed histograms in CIE Lab."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int
from scipy import ndimage

BINS = (10, 24, 24)
"""Bins in L, a and b: few in L, which light and shadow change across one thing."""
LOW = np.array([0.0, -90.0, -90.0])
HIGH = np.array([100.0, 90.0, 90.0])
SMOOTHING = 0.8
"""Standard deviation of the smoothing, in bins (10 L units, 7.5 a and b units)."""
UNKNOWN = 0.1
"""Share of a label's colours that may be any: what is rare in all labels says nothing."""
TOTAL = BINS[0] * BINS[1] * BINS[2]


def colour_bins(lab: Float[np.ndarray, "*n 3"]) -> Int[np.ndarray, "*n"]:
    """Return the flat histogram bin of each Lab colour."""
    index = ((lab - LOW) / (HIGH - LOW) * BINS).astype(np.int64)
    index = np.clip(index, 0, np.array(BINS) - 1)
    return (index[..., 0] * BINS[1] + index[..., 1]) * BINS[2] + index[..., 2]


def colour_counts(
    bins: Int[np.ndarray, " n"], evidence: Float[np.ndarray, "n labels"]
) -> Float[np.ndarray, "labels bins"]:
    """Sum the labels' evidence over the bins."""
    return np.stack(
        [np.bincount(bins, weights, minlength=TOTAL) for weights in evidence.T.astype(float)]
    )


def colour_posterior(
    counts: Float[np.ndarray, "labels bins"], prior: Float[np.ndarray, " labels"]
) -> Float[np.ndarray, "bins labels"]:
    """Return each bin's label probabilities, labels being as common as ``prior`` says.

    A colour that is rare in all labels says nothing: there the prior holds.
    """
    cubes = counts.reshape(len(counts), *BINS)
    smooth = ndimage.gaussian_filter(cubes, (0, SMOOTHING, SMOOTHING, SMOOTHING))
    total = smooth.sum((1, 2, 3), keepdims=True)
    density = np.where(total > 0, smooth / np.maximum(total, 1e-12), 0).reshape(len(counts), -1)
    joint = (density + UNKNOWN / TOTAL) * prior[:, None]
    return (joint / np.maximum(joint.sum(0), 1e-30)).T
