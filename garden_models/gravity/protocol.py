"""Say what every gravity cue does: read a reconstruction as possible verticals.

A cue rarely knows the vertical outright. Planes offer several normals, line segments
several vanishing points, camera axes a level and a rolled reading. So a cue gives ``Mode``s,
each an uncertain axis with a probability; what is left of the probability says "anywhere".
Fusion multiplies the cues' mixtures, so the axis on which they agree wins, and a cue whose
favourite is wrong loses without harm. Up and down are told apart by ``SignEvidence`` only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from garden_models.geometry.direction import (
    Form,
    least_axis,
    log_density,
    pole_form,
    soften,
    total_sigma_deg,
)
from garden_models.scene import GravityEvidence, Reconstruction

Direction = Float[np.ndarray, "3"]
SignVote = Callable[[Direction], float]
"""Log odds that the given direction points down rather than up."""

Method = Callable[[Reconstruction], GravityEvidence | None]
"""A gravity method by itself; None where its evidence is missing from the scene."""


def says_nothing(down: Direction) -> float:
    """Return log odds 0: this cue cannot tell up from down."""
    return 0.0


@dataclass(frozen=True)
class Mode:
    """One reading of a cue: the vertical is ``axis`` up to ``form``, with ``probability``."""

    form: Form
    probability: float
    note: str

    @property
    def axis(self) -> Direction:
        """The best axis of the form (sign undefined)."""
        return least_axis(self.form)[0]

    @property
    def sigma_deg(self) -> float:
        """Expected angular error of ``axis``, degrees."""
        return total_sigma_deg(self.form)


@dataclass(frozen=True)
class Cue:
    """A method's modes and its vote on which way along them is down.

    ``claims_vertical`` is False for a cue that names directions of the scene without saying
    that one of them is upright: it then does not disagree when none is. ``directions`` are
    the axes of built things that the cue has seen, upright or not.
    """

    method: str
    modes: tuple[Mode, ...]
    down_log_odds: SignVote = says_nothing
    claims_vertical: bool = True
    directions: tuple[Direction, ...] = ()

    def log_likelihoods(
        self, axes: Float[np.ndarray, "n 3"], blur_rad: float = 0.0
    ) -> Float[np.ndarray, "n modes_1"]:
        """Return the log density of every mode at unit axes; the last column is "anywhere".

        ``blur_rad`` widens every mode first.
        """
        columns = [
            np.log(m.probability)
            + log_density(soften(m.form, blur_rad) if blur_rad else m.form, axes)
            for m in self.modes
        ]
        anywhere = max(1.0 - sum(m.probability for m in self.modes), 1e-6)
        return np.stack([*columns, np.full(len(axes), np.log(anywhere))], axis=1)

    def alone(self, habit: Cue | None = None) -> GravityEvidence:
        """Return what the cue says by itself: its likeliest mode, turned down by its vote.

        ``habit`` helps a cue that names directions without saying which one is upright.
        """
        helpers = (self,) if habit is None else (self, habit)

        def score(mode: Mode) -> float:
            logs = (h.log_likelihoods(mode.axis[None])[0] for h in helpers)
            return sum(float(np.logaddexp.reduce(log)) for log in logs)

        mode = max(self.modes, key=score)
        odds = sum(h.down_log_odds(mode.axis) for h in helpers)
        down = mode.axis if odds >= 0 else -mode.axis
        return GravityEvidence(self.method, down, mode.sigma_deg, True, mode.note)


SPOILT = 0.15
"""Probability that a method which states one direction has failed outright."""


def cue_of_evidence(evidence: GravityEvidence) -> Cue:
    """Return a method's single signed answer as a cue, with room for it to be wrong."""
    form = pole_form(evidence.down_world, np.radians(evidence.sigma_deg) / np.sqrt(2))
    return Cue(
        evidence.method,
        (Mode(form, 1 - SPOILT, evidence.note),),
        lambda down: 4.0 * float(down @ evidence.down_world),
    )
