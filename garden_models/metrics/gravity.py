"""Score gravity directions: angular error, mean, 90th percentile, failure rate, a table.

The paper's gravity table reports mean, P90 and the share of scenes off by more than 10
degrees. A method that gives no answer is counted at 90 degrees, what a direction drawn at
random is off by on average.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from garden_models.geometry.rotation import angle_between_deg
from garden_models.scene import GravityEvidence, Reconstruction

Direction = Float[np.ndarray, "3"]
Method = Callable[[Reconstruction], GravityEvidence | None]

FAILED_DEG = 10.0
NO_ANSWER_DEG = 90.0


@dataclass(frozen=True)
class GravityTruth:
    """One scene to be scored: its reconstruction and the true unit direction down in it."""

    scene: str
    reconstruction: Reconstruction
    down_world: Direction


@dataclass(frozen=True)
class MethodErrors:
    """A method's angular error in each scene (degrees) and its own sigma there (NaN: none)."""

    method: str
    scenes: tuple[str, ...]
    errors_deg: Float[np.ndarray, " scenes"]
    sigmas_deg: Float[np.ndarray, " scenes"]

    @property
    def mean_deg(self) -> float:
        """Mean angular error, degrees."""
        return float(self.errors_deg.mean())

    @property
    def p90_deg(self) -> float:
        """90th percentile of the angular error, degrees (linear between scenes)."""
        return float(np.quantile(self.errors_deg, 0.9))

    def failure_rate(self, limit_deg: float = FAILED_DEG) -> float:
        """Return the share (0..1) of scenes with an error above ``limit_deg``."""
        return float((self.errors_deg > limit_deg).mean())

    @property
    def calibration(self) -> float:
        """Root mean square of error over sigma: 1 if the method knows how good it is."""
        ratio = self.errors_deg / self.sigmas_deg
        ratio = ratio[np.isfinite(ratio)]
        return float(np.sqrt(np.mean(ratio**2))) if len(ratio) else float("nan")


def angular_error_deg(estimated: Direction, true: Direction) -> float:
    """Return the angle between two directions in degrees, 0 to 180: up for down is 180."""
    return angle_between_deg(estimated, true)


def score_methods(
    truths: Iterable[GravityTruth], methods: Mapping[str, Method]
) -> tuple[MethodErrors, ...]:
    """Run every method on every scene; the order of both is kept.

    Raises ValueError if there is no scene.
    """
    truths = list(truths)
    if not truths:
        raise ValueError("no scene to score gravity on")
    scored = []
    for name, estimate in methods.items():
        errors, sigmas = [], []
        for truth in truths:
            evidence = estimate(truth.reconstruction)
            if evidence is None:
                errors.append(NO_ANSWER_DEG)
                sigmas.append(np.nan)
            else:
                errors.append(angular_error_deg(evidence.down_world, truth.down_world))
                sigmas.append(evidence.sigma_deg)
        scenes = tuple(truth.scene for truth in truths)
        scored.append(MethodErrors(name, scenes, np.array(errors), np.array(sigmas)))
    return tuple(scored)


def gravity_table(scored: Sequence[MethodErrors]) -> str:
    """Return a text table: one row a method, its error in every scene, mean, P90, Fail@10."""
    header = ["method", *scored[0].scenes, "mean", "P90", f"fail@{FAILED_DEG:.0f}", "error/sigma"]
    rows = [
        [
            row.method,
            *(f"{error:.2f}" for error in row.errors_deg),
            f"{row.mean_deg:.2f}",
            f"{row.p90_deg:.2f}",
            f"{row.failure_rate():.0%}",
            f"{row.calibration:.2f}",
        ]
        for row in scored
    ]
    widths = [max(len(line[i]) for line in [header, *rows]) for i in range(len(header))]
    lines = [
        "  ".join(cell.ljust(w) if i == 0 else cell.rjust(w) for i, (cell, w) in enumerate(pairs))
        for pairs in (list(zip(line, widths, strict=True)) for line in [header, *rows])
    ]
    return "\n".join(lines)
