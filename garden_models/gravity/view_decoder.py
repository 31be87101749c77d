"""The Gravity-View decoder as a cue: one signed direction with a calibrated uncertainty."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from garden_models.geometry.direction import pole_form
from garden_models.gravity.decoder.checkpoint import Checkpoint, load_checkpoint
from garden_models.gravity.decoder.decode import decode
from garden_models.gravity.decoder.evidence import read_evidence
from garden_models.gravity.decoder.shipped import DIGEST, checkpoint_file
from garden_models.gravity.decoder.token_layout import KIND, TOKEN_WIDTH
from garden_models.gravity.protocol import Cue, Mode
from garden_models.scene import BadInput, GravityEvidence, Reconstruction

METHOD = "view_decoder"
MOST_LOG_ODDS = 5.0
"""However sure the decoder is, cues together may tell it that it has up for down."""
STRANGE_SPOILT = 0.6
"""Least probability of being wrong of an answer about something unlike all it learned from."""


def checkpoint(weights: str = "") -> Checkpoint:
    """Return the decoder of a file, or the shipped one; raise BadInput if there is none."""
    path = Path(weights) if weights else checkpoint_file()
    if path is None:
        raise BadInput(
            "no gravity decoder is shipped with this program: train one with `garden train "
            "gravity` and give it as --set gravity.decoder_weights=FILE, or leave view_decoder "
            "out of gravity.methods"
        )
    return load_checkpoint(path, KIND, TOKEN_WIDTH, "" if weights else DIGEST)


def read(reconstruction: Reconstruction, weights: str = "") -> Cue | None:
    """Return the decoder's answer; None for a reconstruction without surfaces and lines.

    Raises BadInput for a checkpoint or a reconstruction that does not fit.
    """
    return read_with(checkpoint(weights), reconstruction)


def read_with(known: Checkpoint, reconstruction: Reconstruction) -> Cue | None:
    """Return the answer of a loaded decoder."""
    evidence = read_evidence(reconstruction)
    if not (evidence.normal_weight.any() or evidence.line_weight.any()):
        return None
    found = decode(known.model, evidence)
    if known.calibration is None or known.familiarity is None:
        raise BadInput("this gravity decoder was not calibrated: train it with `garden train`")
    sigma = known.calibration.sigma(found.claimed_rad)
    spoilt = known.calibration.spoilt
    strange = known.familiarity.strangeness(found.tokens)
    note = f"decoder {known.digest[:8]}, {found.agreement:.0%} of the starts agree"
    if strange > 1:
        spoilt = max(spoilt, STRANGE_SPOILT)
        note += f"; unlike what it learned from ({strange:.1f} times the limit)"
    down = found.down_world
    odds = min(float(np.log((1 - spoilt) / spoilt)), MOST_LOG_ODDS)
    form = pole_form(down, sigma / np.sqrt(2))
    return Cue(
        METHOD, (Mode(form, 1 - spoilt, note),), lambda other: max(odds, 0.0) * float(other @ down)
    )


def estimate(reconstruction: Reconstruction, weights: str = "") -> GravityEvidence | None:
    """Return gravity from the decoder alone, None where it has nothing to read."""
    cue = read(reconstruction, weights)
    return None if cue is None else cue.alone()
