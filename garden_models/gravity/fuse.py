"""Fuse cues: the axis on which their mixtures agree, its uncertainty, which way is down.

The log posterior of an axis is the sum over cues of the log of their mixtures. It is climbed
from every cue's every mode by expectation maximisation: the modes' responsibilities at the
axis weight their forms, and the sum of forms gives the next axis. A cue whose modes are all
far away is then explained by its "anywhere" part and pulls no more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from garden_models.geometry.direction import (
    Form,
    axis_angle_deg,
    least_axis,
    log_density,
    pole_form,
    soften,
    total_sigma_deg,
)
from garden_models.gravity.protocol import Cue, Mode
from garden_models.scene import BadGeometry, GravityEvidence, Verdict

Direction = Float[np.ndarray, "3"]

CLIMB = 30
STILL = 1e-9
RIVAL_DEG = 10.0
"""A second axis this far off is another answer, not the same one less exactly."""
RIVAL_LOG_ODDS = 1.5
SIGN_LOG_ODDS = 1.5
LARGE_SIGMA_DEG = 3.0
SAME_DEG = 1.0
SAME_SUMMIT_DEG = 0.1
BLUR = np.radians(4.0)
"""Modes are blurred by this before summits are compared: which reading is right must not
hang on how exactly cues agree, for what is built is rarely as exact as it is measured."""
OPEN_TILT = np.radians(30.0)
SQUARE_DEG = 4.0
OPEN_SIGMA = np.radians(15.0)
"""What a reading knows worse than this is taken from the result when the two are compared."""
WORLD_SIGMA = np.radians(0.3)
"""Bending of the estimated cameras, which tilts all cues alike."""
CLAIM = 0.3
"""Probability from which a cue's first reading is a claim that others may contradict."""


@dataclass(frozen=True)
class FusedGravity:
    """Gravity in the world with its expected angular error, each cue's part, and the verdict."""

    down_world: Direction
    sigma_deg: float
    evidence: tuple[GravityEvidence, ...]
    verdict: Verdict


@dataclass(frozen=True)
class _Summit:
    """An axis the cues agree on: ``score`` is its log probability among summits close by,
    ``reading`` among all (modes blurred).
    """

    axis: Direction
    score: float
    reading: float
    form: Form


def _climb(cues: tuple[Cue, ...], start: Direction) -> _Summit:
    axis, form = start, np.zeros((3, 3))
    for _ in range(CLIMB):
        form = np.zeros((3, 3))
        for cue in cues:
            logs = cue.log_likelihoods(axis[None])[0]
            responsibility = np.exp(logs - np.logaddexp.reduce(logs))
            for mode, share in zip(cue.modes, responsibility, strict=False):
                form += share * mode.form
        again = least_axis(form)[0]
        moved = np.linalg.norm(np.cross(axis, again))
        axis = again
        if moved < STILL:
            break
    # A summit counts by the probability it holds, not by its height: a narrow accident among
    # many is no better founded than a broad agreement.
    sharp = [cue.log_likelihoods(axis[None])[0] for cue in cues]
    score = _total(sharp) - float(log_density(form, axis[None])[0])
    broad = [cue.log_likelihoods(axis[None], BLUR)[0] for cue in cues]
    reading = _total(broad) - float(log_density(soften(form, BLUR), axis[None])[0])
    for cue, logs in zip(cues, broad, strict=True):
        reading += _frame_credit(cue, logs, cues, axis)
    return _Summit(axis, score, reading, form)


def _total(logs: list[Float[np.ndarray, " modes_1"]]) -> float:
    return sum(float(np.logaddexp.reduce(log)) for log in logs)


def _frame_credit(
    cue: Cue, logs: Float[np.ndarray, " modes_1"], cues: tuple[Cue, ...], axis: Direction
) -> float:
    """Return what an upright wall gains if another cue's level directions run along it.

    A horizontal surface names the vertical outright, a wall leaves it open, so the wall would
    lose to the same wall read as a floor. But if level edges run along the wall or square to
    it, the room's frame explains both, and which of its axes is upright is an open question.
    """
    best = int(np.argmax(logs))
    if best == len(cue.modes) or least_axis(cue.modes[best].form)[1][0] < OPEN_TILT:
        return 0.0
    level = np.sin(np.radians(SQUARE_DEG))
    own = [d for d in cue.directions if abs(d @ axis) < level]
    others = [d for c in cues if c is not cue for d in c.directions if abs(d @ axis) < level]
    for a in own:
        for b in others:
            angle = axis_angle_deg(a, b)
            if min(angle, 90 - angle) < SQUARE_DEG:
                return float(np.log(1 / BLUR))
    return 0.0


def _spread_deg(summits: list[_Summit], best: _Summit) -> float:
    """Return the expected angular error, with what summits close by would have said instead."""
    distinct: list[_Summit] = []
    for summit in sorted(summits, key=lambda s: -s.score):
        if all(axis_angle_deg(summit.axis, other.axis) > SAME_SUMMIT_DEG for other in distinct):
            distinct.append(summit)
    mass = np.exp([summit.score - best.score for summit in distinct])
    square = [
        total_sigma_deg(soften(s.form, WORLD_SIGMA)) ** 2 + axis_angle_deg(s.axis, best.axis) ** 2
        for s in distinct
    ]
    return float(np.sqrt(mass @ square / mass.sum()))


def _nearest_axis(mode: Mode, down: Direction) -> Direction:
    """Return the axis of a mode, turned to ``down``; what it leaves open is taken from there."""
    axis = least_axis(mode.form + pole_form(down, OPEN_SIGMA))[0]
    return axis if axis @ down >= 0 else -axis


def _evidence(cue: Cue, down: Direction, limit_deg: float) -> tuple[GravityEvidence, str]:
    """Return a cue's part in the result, and why it disagrees ('' if it does not)."""
    logs = cue.log_likelihoods(down[None])[0]
    best = int(np.argmax(logs))
    if best < len(cue.modes):
        mode = cue.modes[best]
        axis = _nearest_axis(mode, down)
        return GravityEvidence(cue.method, axis, mode.sigma_deg, True, mode.note), ""
    mode = max(cue.modes, key=lambda m: m.probability)
    axis = _nearest_axis(mode, down)
    angle = axis_angle_deg(axis, down)
    note = f"not used, its first reading is {angle:.1f} degrees off ({mode.note})"
    claim = sum(m.probability for m in cue.modes if axis_angle_deg(m.axis, mode.axis) < SAME_DEG)
    quarrel = cue.claims_vertical and claim > CLAIM and angle > limit_deg
    why = f"gravity: {cue.method} differs by {angle:.1f} degrees ({mode.note})"
    lost = GravityEvidence(cue.method, axis, mode.sigma_deg, False, note)
    return lost, why if quarrel else ""


def fuse_cues(cues: tuple[Cue, ...], max_disagreement_deg: float = 5.0) -> FusedGravity:
    """Return gravity from cues; raises BadGeometry if none of them says anything."""
    cues = tuple(cue for cue in cues if cue.modes)
    if not cues:
        raise BadGeometry(
            "nothing tells where gravity is: no planes, no line segments and fewer than two "
            "cameras; add photos of the surroundings, with a table or floor in sight"
        )
    summits = [_climb(cues, mode.axis) for cue in cues for mode in cue.modes]
    # First which reading (of the far apart), then which axis exactly.
    winner = max(summits, key=lambda s: s.reading)
    near = [s for s in summits if axis_angle_deg(s.axis, winner.axis) < RIVAL_DEG]
    rivals = [s for s in summits if axis_angle_deg(s.axis, winner.axis) >= RIVAL_DEG]
    best = max(near, key=lambda s: s.score)
    lead = winner.reading - max((s.reading for s in rivals), default=-np.inf)
    log_odds = sum(cue.down_log_odds(best.axis) for cue in cues)
    down = best.axis if log_odds >= 0 else -best.axis
    parts = [_evidence(cue, down, max_disagreement_deg) for cue in cues]
    evidence = tuple(part for part, _ in parts)
    sigma = _spread_deg(near, best)

    reasons = [why for _, why in parts if why]
    if lead < RIVAL_LOG_ODDS:
        rival = max(rivals, key=lambda s: s.reading)
        angle = axis_angle_deg(rival.axis, best.axis)
        reasons.append(f"gravity: another axis, {angle:.0f} degrees away, is nearly as likely")
    if abs(log_odds) < SIGN_LOG_ODDS:
        reasons.append("gravity: hardly anything tells up from down")
    if sigma > LARGE_SIGMA_DEG:
        reasons.append(f"gravity is known to {sigma:.1f} degrees only")
    accepted = [e for e in evidence if e.accepted]
    if len(accepted) == 1:
        reasons.append(f"gravity rests on one cue alone: {accepted[0].method}")
    verdict = Verdict("degraded", tuple(reasons)) if reasons else Verdict()
    return FusedGravity(down, sigma, evidence, verdict)
