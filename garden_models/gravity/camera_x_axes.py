"""The photographer's habit: cameras are held level, so gravity is perpendicular to their x.

A camera rolled by a quarter turn has its y axis level instead. Both readings, and a mixture
of landscape and portrait photos, are tried; a reading is likely if its axes lie close to one
great circle. The axes share the photographer's bias, so many photos do not make the answer
exact, and cameras that all look one way fix only the roll: the other tilt then comes from
the weak habit of looking roughly level.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from garden_models.geometry.direction import hemisphere, least_axis, soften
from garden_models.gravity.protocol import Cue, Mode
from garden_models.scene import GravityEvidence, Reconstruction

Rotations = Float[np.ndarray, "n 3 3"]
Axes = Float[np.ndarray, "n 3"]

METHOD = "camera_x_axes"

ROLL_SPREAD = np.radians(3.0)
"""Roll of a photo held by hand about the photographer's own mean."""
ROLL_BIAS = np.radians(2.0)
"""Roll that all photos of a capture share (a lopsided grip, a crooked mount)."""
PITCH_SPREAD = np.radians(20.0)
PITCH_BIAS = np.radians(30.0)
MODEL_ERROR = np.radians(1.0)
"""What a habit cannot promise however many photos keep it."""

INDEPENDENT_PHOTOS = 5.0
"""One hand takes all photos of a capture and its roll wanders slowly: however many photos
there are, they count as this many."""
USUAL_PHOTOS = 3.0
"""How many photos' worth the usual steadiness counts against a capture's own."""
PRIOR_LEVEL, PRIOR_ROLLED, PRIOR_MIXED = 0.87, 0.09, 0.04
NO_HABIT, NO_HABIT_DIVERSE = 0.08, 0.02
"""Probability that no reading holds. Photos that look many ways and still keep one great
circle keep it by habit; photos that all look one way may be crooked alike."""
ONE_WAY = np.radians(20.0)
"""Uncertainty of the worse tilt from which the photos count as looking one way."""
UPSIDE_DOWN = 0.003
"""Share of captures that are level but upside down (EXIF orientation is applied before)."""
LOOKING_DOWN = np.radians(15.0)
"""Indoor photos of things look down by about this much on average."""
GRID = 3000


def shared_bias_form(axes: Axes, spread: float, bias: float) -> Float[np.ndarray, "3 3"]:
    """Return the form of "perpendicular to ``axes``" with independent and shared error.

    The residuals ``axes @ g`` have covariance ``C = spread^2 I + bias^2 11'``, the
    spread widened so that many photos count as few; the form is ``A' C^-1 A`` by
    Sherman-Morrison.
    """
    total = axes.sum(0)
    variance = spread**2 * max(1.0, len(axes) / INDEPENDENT_PHOTOS)
    coupling = bias**2 / (variance + len(axes) * bias**2)
    return (axes.T @ axes - coupling * np.outer(total, total)) / variance


def robust_log(residuals: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Return the log likelihood of level residuals: Gaussian with a share of careless photos."""
    sigma = np.hypot(ROLL_SPREAD, ROLL_BIAS)
    level = np.exp(-0.5 * (residuals / sigma) ** 2) / (sigma * np.sqrt(2 * np.pi))
    return np.log(0.95 * level + 0.05 * 0.5)


def reading(level: Axes, forward: Axes, note: str, share: float) -> Mode:
    """Return the mode of one assignment of level axes, refined with careless photos left out.

    ``share`` is its probability among the readings if there is a habit at all.
    """
    sigma = np.hypot(ROLL_SPREAD, ROLL_BIAS)
    pitch = shared_bias_form(forward, PITCH_SPREAD, PITCH_BIAS)
    kept = np.ones(len(level), dtype=bool)
    for _ in range(10):
        form = shared_bias_form(level[kept], ROLL_SPREAD, ROLL_BIAS) + pitch
        residuals = np.abs(level @ least_axis(form)[0])
        again = residuals < max(3 * sigma, float(np.median(residuals)))
        if np.array_equal(again, kept):
            break
        kept = again
    axis, _, _ = least_axis(form)
    # The residuals tell how steady this hand is; few photos (two of them used up by the
    # fit) leave it near what hands usually are.
    rms = float(np.sqrt(np.mean((level[kept] @ axis) ** 2)))
    photos = min(float(kept.sum()), INDEPENDENT_PHOTOS)
    form = form * (USUAL_PHOTOS + max(photos - 2, 0)) / (USUAL_PHOTOS + photos * (rms / sigma) ** 2)
    words = f"{note}: {kept.sum()} of {len(level)} photos within {np.degrees(rms):.1f} degrees rms"
    form = soften(form, MODEL_ERROR)
    _, sigmas, _ = least_axis(form)
    diverse = 1 - min(1.0, float(sigmas[0]) / ONE_WAY)
    return Mode(form, share * (1 - NO_HABIT + diverse * (NO_HABIT - NO_HABIT_DIVERSE)), words)


def read(reconstruction: Reconstruction) -> Cue | None:
    """Return the readings of the cameras' axes; None for a single camera."""
    rotations = np.array([v.camera_from_world[:3, :3] for v in reconstruction.views])
    if len(rotations) < 2:
        return None
    x, y, forward = rotations[:, 0], rotations[:, 1], rotations[:, 2]
    grid = hemisphere(GRID)
    log_x, log_y = robust_log(x @ grid.T), robust_log(y @ grid.T)
    choice = np.logaddexp(log_x, log_y) - np.log(2)
    temper = min(1.0, INDEPENDENT_PHOTOS / len(rotations))
    pitch = shared_bias_form(forward, PITCH_SPREAD, PITCH_BIAS)
    habit = -0.5 * np.einsum("gi,ij,gj->g", grid, pitch, grid)
    readings = {
        "level": (PRIOR_LEVEL, log_x),
        "rolled by a quarter turn": (PRIOR_ROLLED, log_y),
        "level and rolled mixed": (PRIOR_MIXED, choice),
    }
    evidence = {
        name: np.log(prior) + temper * logs.sum(0) + habit
        for name, (prior, logs) in readings.items()
    }
    mass = {name: float(np.logaddexp.reduce(values)) for name, values in evidence.items()}
    total = float(np.logaddexp.reduce(list(mass.values())))
    modes = []
    for name, values in evidence.items():
        best = grid[int(np.argmax(values))]
        if name == "level":
            level = x
        elif name == "level and rolled mixed":
            level = np.where((np.abs(x @ best) <= np.abs(y @ best))[:, None], x, y)
        else:
            level = y
        share = float(np.exp(mass[name] - total))
        if share > 1e-6:
            modes.append(reading(level, forward, name, share))
    return Cue(METHOD, tuple(modes), lambda down: camera_sign(rotations, down))


def camera_sign(rotations: Rotations, down: Float[np.ndarray, "3"]) -> float:
    """Return log odds of ``down`` against up: level photos are seldom upside down, and
    photos look rather down than up.
    """
    x, y, pitch = (rotations @ down).T
    level = np.exp(robust_log(x) - np.logaddexp(robust_log(x), robust_log(y)))
    # A photo straight down or up has no upright side: its vote fades with its y component.
    upright = level * np.clip(y / np.sin(np.radians(20.0)), -1, 1)
    held = float(upright.mean()) * np.log((1 - UPSIDE_DOWN) / UPSIDE_DOWN)
    # Equal Gaussians about +15 and -15 degrees, counted as two independent photos.
    looks = float(np.clip(np.arcsin(np.clip(pitch, -1, 1)).mean(), -1, 1))
    return held + 2 * 2 * LOOKING_DOWN * looks / np.radians(25.0) ** 2


def estimate(reconstruction: Reconstruction) -> GravityEvidence | None:
    """Return gravity from the cameras' axes alone, or None for a single camera."""
    cue = read(reconstruction)
    return None if cue is None else cue.alone()
