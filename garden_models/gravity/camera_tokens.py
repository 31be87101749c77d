"""Gravity from the camera tokens of a geometry model, as a cue (paper, supplement A)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from garden_models.geometry.direction import pole_form
from garden_models.geometry.rotation import angle_between_deg, normalized
from garden_models.gravity.decoder.checkpoint import Checkpoint, load_checkpoint
from garden_models.gravity.decoder.from_tokens import down_from_tokens
from garden_models.gravity.protocol import SPOILT, Cue, Mode
from garden_models.gravity.token_config import TokenGravity
from garden_models.gravity.view_decoder import MOST_LOG_ODDS, STRANGE_SPOILT
from garden_models.reconstruction.geometry_model import CameraTokens, GeometryPrediction
from garden_models.scene import BadInput

METHOD = "camera_tokens"
UNCLAIMED = np.radians(3.0)
"""Error of a network that claims none."""
SAME_DEG = 10.0
"""Chunks whose answers are further from the middle one have no part in it."""


@dataclass(frozen=True)
class _Answer:
    down: np.ndarray
    sigma: float
    spoilt: float
    views: int


def token_cue(prediction: GeometryPrediction, config: TokenGravity) -> Cue:
    """Return the decoder's answer to a prediction's tokens; each chunk of photos votes.

    Raises BadInput if the prediction has no tokens, or the checkpoint reads others.
    """
    if not prediction.camera_tokens:
        raise BadInput(
            "the prediction holds no camera tokens, which gravity is to be read from: set "
            "geometry.camera_tokens = true with a model that has them (depth_anything_3), or "
            "leave token_gravity.weights empty"
        )
    first = prediction.camera_tokens[0]
    known = load_checkpoint(Path(config.weights), first.kind, first.tokens.shape[1])
    answers = [_answer(known, tokens, prediction) for tokens in prediction.camera_tokens]
    middle = min(
        answers, key=lambda a: sum(angle_between_deg(a.down, b.down) * b.views for b in answers)
    )
    agreeing = [a for a in answers if angle_between_deg(a.down, middle.down) < SAME_DEG]
    down = normalized(np.sum([a.views * a.down for a in agreeing], axis=0))
    spread = np.radians(np.mean([angle_between_deg(a.down, down) for a in agreeing]))
    sigma = max(float(np.mean([a.sigma for a in agreeing])), float(spread))
    spoilt = max(a.spoilt for a in agreeing)
    share = sum(a.views for a in agreeing) / sum(a.views for a in answers)
    if share <= 0.5:
        spoilt = max(spoilt, STRANGE_SPOILT)
    odds = min(float(np.log((1 - spoilt) / spoilt)), MOST_LOG_ODDS)
    note = f"decoder {known.digest[:8]} on {first.kind}, {share:.0%} of the photos agree"
    return Cue(
        METHOD,
        (Mode(pole_form(down, sigma / np.sqrt(2)), 1 - spoilt, note),),
        lambda other: max(odds, 0.0) * float(other @ down),
    )


def _answer(known: Checkpoint, tokens: CameraTokens, prediction: GeometryPrediction) -> _Answer:
    cameras = np.stack([prediction.views[i].camera_from_world for i in tokens.views])
    reference = int(np.flatnonzero(tokens.views == tokens.reference)[0])
    down, claimed = down_from_tokens(known, tokens.tokens, reference, cameras)
    sigma, spoilt = UNCLAIMED, SPOILT
    if known.calibration is not None and claimed is not None:
        sigma, spoilt = known.calibration.sigma(claimed), known.calibration.spoilt
    if known.familiarity is not None and known.familiarity.strangeness(tokens.tokens) > 1:
        spoilt = max(spoilt, STRANGE_SPOILT)
    return _Answer(down, sigma, spoilt, len(tokens.views))
