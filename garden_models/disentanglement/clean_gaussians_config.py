"""Configure what is kept of the predicted Gaussians."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CleanGaussians:
    """A model predicts one Gaussian a pixel of every photo; of these ``max_gaussians`` are kept
    (70 MB of ``splat.ply`` a million).
    """

    max_gaussians: int = 1_000_000
