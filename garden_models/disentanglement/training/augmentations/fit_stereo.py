"""Learn the noise of our stereo from depth maps with known truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import maximum_filter, minimum_filter, uniform_filter

from garden_models.disentanglement.training.augmentations.config import StereoNoise
from garden_models.disentanglement.training.augmentations.stereo_noise import EDGE

Depth = Float[np.ndarray, "h w"]
WINDOW = 7
"""Pixels over which neighbours' common error is measured; edges reach as far."""
OUTLIER = 0.05
"""Relative errors beyond it are no noise but mistakes."""
DEPTH_BINS = 8
LEAST_IN_BIN = 200
BETWEEN = 0.02
"""A depth that keeps this share from both sides of an edge lies between them."""


@dataclass(frozen=True)
class _Residuals:
    """Relative errors of one map where there is truth (nan: no depth), in units of its median
    depth, and where a depth edge is near.
    """

    error: Depth
    depth: Depth
    at_edge: Bool[np.ndarray, "h w"]
    between: Bool[np.ndarray, "h w"]
    known: Bool[np.ndarray, "h w"]


def fit_stereo_noise(maps: Sequence[tuple[Depth, Depth]]) -> StereoNoise:
    """Return the settings that describe estimated z-depth maps against true ones (0: none).

    Depth maps are in the same unit as their truth, metres. Raises ValueError if nothing can
    be compared.
    """
    found = [_residuals(estimate, truth) for estimate, truth in maps if (truth > 0).any()]
    inner = [r.known & ~r.at_edge for r in found]
    errors = np.concatenate([r.error[i] for r, i in zip(found, inner, strict=True)] or [[]])
    depths = np.concatenate([r.depth[i] for r, i in zip(found, inner, strict=True)] or [[]])
    good = np.abs(errors) < OUTLIER
    if good.sum() < LEAST_IN_BIN:
        raise ValueError("too few pixels have both an estimated and a true depth")
    sigma, growth = _growth(errors[good], depths[good])
    edges = np.concatenate([r.error[r.known & r.at_edge] for r in found])
    between = np.concatenate([r.between[r.known & r.at_edge] for r in found])
    seen = np.isfinite(edges)
    return StereoNoise(
        sigma=round(sigma, 5),
        growth=round(growth, 5),
        correlated=round(_correlated(found), 3),
        holes=round(float(np.isnan(errors).mean()), 3),
        edge_holes=round(float((~seen).mean()), 3) if len(edges) else 0.0,
        smeared=round(float(between[seen].mean()), 3) if seen.any() else 0.0,
    )


def _residuals(estimate: Depth, truth: Depth) -> _Residuals:
    known = truth > 0
    far = maximum_filter(truth, WINDOW)
    near = minimum_filter(np.where(known, truth, np.inf), WINDOW)
    at_edge = known & (far > (1 + EDGE) * near)
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.where(known & (estimate > 0), estimate / truth - 1, np.nan)
    between = at_edge & (estimate > (1 + BETWEEN) * near) & (estimate < (1 - BETWEEN) * far)
    # Between its sides there may be a third surface: only what is off the truth is smeared.
    between &= np.abs(np.nan_to_num(error, nan=0.0)) > BETWEEN
    return _Residuals(error, truth / float(np.median(truth[known])), at_edge, between, known)


def _growth(errors: np.ndarray, depths: np.ndarray) -> tuple[float, float]:
    """Return the 1-sigma of errors at the median depth and its growth with depth."""
    order = np.argsort(depths)
    centres, sigmas = [], []
    for part in np.array_split(order, DEPTH_BINS):
        if len(part) >= LEAST_IN_BIN // DEPTH_BINS:
            centres.append(np.median(depths[part]) - 1)
            sigmas.append(1.4826 * np.median(np.abs(errors[part] - np.median(errors[part]))))
    if len(centres) < 2 or np.ptp(centres) < 1e-6:
        return float(np.median(sigmas)), 0.0
    slope, level = np.polyfit(centres, sigmas, 1)
    return float(max(level, 1e-5)), float(max(slope, 0.0))


def _correlated(found: Sequence[_Residuals]) -> float:
    """Return the share of the errors' variance that a pixel's window has in common."""
    total = common = 0.0
    for r in found:
        good = r.known & ~r.at_edge & (np.abs(np.nan_to_num(r.error, nan=np.inf)) < OUTLIER)
        weight = uniform_filter(good.astype(float), WINDOW)
        mean = uniform_filter(np.where(good, r.error, 0.0), WINDOW) / np.maximum(weight, 1e-9)
        full = good & (weight > 0.8)
        if full.any():
            total += float(np.var(r.error[full])) * full.sum()
            common += float(np.var(mean[full])) * full.sum()
    if total == 0:
        return 0.0
    alone = 1 / WINDOW**2  # what the mean of independent errors would have
    return float(np.clip((common / total - alone) / (1 - alone), 0, 1))
