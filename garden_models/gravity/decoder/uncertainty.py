"""Make a claimed error honest: a map from what the network claims to what came of it.

The angular error of a direction with total sigma ``s`` (root mean square) is taken to follow
``P(error < t s) = 1 - exp(-t^2)``, two equal Gaussian tilts. The map is fitted on validation
scenes by bins of equally many scenes; it rises with the claim.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

BINS = 8
LEAST_IN_BIN = 10
FITTED_SHARE = 0.8
"""Share of a bin's errors that the map is fitted to cover; what is worse counts as spoilt
beyond ``WILD`` sigmas."""
WILD = 3.0
LEAST_SPOILT = 0.01


@dataclass(frozen=True)
class Calibration:
    """``log_claimed`` (rising) and ``log_true`` are knots, natural logs of radians;
    ``spoilt`` is the share of answers that no sigma covers.
    """

    log_claimed: tuple[float, ...]
    log_true: tuple[float, ...]
    spoilt: float

    def sigma(self, claimed_rad: float) -> float:
        """Return the total sigma in radians for a claimed one; beyond the knots the nearest
        knot's factor holds.
        """
        log = float(np.log(claimed_rad))
        inside = float(np.clip(log, self.log_claimed[0], self.log_claimed[-1]))
        return float(np.exp(np.interp(inside, self.log_claimed, self.log_true) + log - inside))


def calibrate(
    claimed_rad: Float[np.ndarray, " n"], error_rad: Float[np.ndarray, " n"]
) -> Calibration:
    """Return the calibration for claims and the errors that came of them (radians).

    Raises ValueError for fewer than ``LEAST_IN_BIN`` scenes.
    """
    if len(claimed_rad) < LEAST_IN_BIN:
        raise ValueError(f"{len(claimed_rad)} scenes are too few to calibrate on")
    order = np.argsort(claimed_rad, kind="stable")
    bins = np.array_split(order, max(1, min(BINS, len(order) // LEAST_IN_BIN)))
    reach = np.sqrt(-np.log(1 - FITTED_SHARE))
    knots = np.array([np.log(claimed_rad[b]).mean() for b in bins])
    covered = [max(float(np.quantile(error_rad[b], FITTED_SHARE)), 1e-4) / reach for b in bins]
    rising = np.maximum.accumulate(np.log(covered))
    fitted = Calibration(tuple(knots.tolist()), tuple(rising.tolist()), 0.0)
    sigma = np.array([fitted.sigma(c) for c in claimed_rad])
    wild = float((error_rad > WILD * sigma).mean())
    return Calibration(fitted.log_claimed, fitted.log_true, max(wild, LEAST_SPOILT))


def coverage(
    sigma_rad: Float[np.ndarray, " n"], error_rad: Float[np.ndarray, " n"], share: float
) -> float:
    """Return the share of errors within the radius that should hold ``share`` of them."""
    radius = sigma_rad * np.sqrt(-np.log(1 - share))
    return float((error_rad <= radius).mean())
