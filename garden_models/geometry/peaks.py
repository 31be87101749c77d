"""Find the peaks of a weighted one-dimensional density (paper, section 3.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy import ndimage, signal

BINS_PER_BANDWIDTH = 4
MAX_BINS = 65536


@dataclass(frozen=True)
class Peak:
    """A local maximum of a density: where, and the share of all weight near it."""

    position: float
    share: float


def density_peaks(
    values: Float[np.ndarray, " n"],
    weights: Float[np.ndarray, " n"],
    bandwidth: float,
    *,
    min_share: float = 0.0,
) -> tuple[Peak, ...]:
    """Return the peaks of the Gaussian kernel density of ``values``, heaviest first.

    ``bandwidth`` is the kernel's standard deviation in the unit of the values. A peak's
    ``share`` is the part of the total weight (0..1) within two bandwidths of it; peaks of
    less than ``min_share`` are left out. No values or no weight: no peaks. Raises
    ValueError for a bandwidth that is not positive.
    """
    if not bandwidth > 0:
        raise ValueError(f"bandwidth must be positive, got {bandwidth}")
    total = float(weights.sum())
    if len(values) == 0 or total <= 0:
        return ()
    low, high = float(values.min()) - 4 * bandwidth, float(values.max()) + 4 * bandwidth
    bins = int(np.clip(np.ceil((high - low) / bandwidth * BINS_PER_BANDWIDTH), 8, MAX_BINS))
    histogram, edges = np.histogram(values, bins, (low, high), weights=weights)
    step = edges[1] - edges[0]
    density = ndimage.gaussian_filter1d(histogram, bandwidth / step, mode="constant")
    cumulative = np.concatenate([[0.0], np.cumsum(histogram)])
    peaks = []
    for index in signal.find_peaks(density)[0]:
        position = edges[0] + (index + 0.5) * step + step * _vertex(density, index)
        inside = np.interp([position - 2 * bandwidth, position + 2 * bandwidth], edges, cumulative)
        share = float(inside[1] - inside[0]) / total
        if share >= min_share:
            peaks.append(Peak(float(position), share))
    return tuple(sorted(peaks, key=lambda peak: (-peak.share, peak.position)))


def _vertex(density: Float[np.ndarray, " b"], index: int) -> float:
    """Return the offset (-0.5..0.5 bins) of the parabola's top through three bins."""
    left, middle, right = density[index - 1 : index + 2]
    curvature = left - 2 * middle + right
    return float(np.clip(0.5 * (left - right) / curvature, -0.5, 0.5)) if curvature < 0 else 0.0
