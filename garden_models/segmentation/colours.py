"""Model what colours the labels have, by smoothed histograms in CIE Lab."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int
from scipy import ndimage

BINS = 20
LOW = np.array([0.0, -90.0, -90.0])
HIGH = np.array([100.0, 90.0, 90.0])
SMOOTHING = 0.8
"""Standard deviation of the smoothing, in bins (5 L units, 9 a and b units)."""


def colour_bins(lab: Float[np.ndarray, "*n 3"]) -> Int[np.ndarray, "*n"]:
    """Return the flat histogram bin of each Lab colour."""
    index = ((lab - LOW) / (HIGH - LOW) * BINS).astype(np.int64)
    index = np.clip(index, 0, BINS - 1)
    return (index[..., 0] * BINS + index[..., 1]) * BINS + index[..., 2]


def colour_counts(
    bins: Int[np.ndarray, " n"], evidence: Float[np.ndarray, "n labels"]
) -> Float[np.ndarray, "labels bins"]:
    """Sum the labels' evidence over the bins."""
    return np.stack(
        [np.bincount(bins, weights, minlength=BINS**3) for weights in evidence.T.astype(float)]
    )


def colour_posterior(counts: Float[np.ndarray, "labels bins"]) -> Float[np.ndarray, "bins labels"]:
    """Return each bin's label probabilities if labels were equally common.

    Where no label has that colour, all are equally likely.
    """
    labels = len(counts)
    cubes = counts.reshape(labels, BINS, BINS, BINS)
    smooth = ndimage.gaussian_filter(cubes, (0, SMOOTHING, SMOOTHING, SMOOTHING))
    total = smooth.sum((1, 2, 3), keepdims=True)
    density = np.where(total > 0, smooth / np.maximum(total, 1e-12), 0).reshape(labels, -1)
    density += 1e-2 / BINS**3 * 8
    return (density / density.sum(0)).T
