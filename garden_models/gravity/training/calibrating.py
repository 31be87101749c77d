"""Calibrate a trained decoder on validation scenes, and learn what its tokens look like."""

from __future__ import annotations

import numpy as np

from garden_models.geometry.rotation import angle_between_deg
from garden_models.gravity.decoder.decode import Decoding, decode
from garden_models.gravity.decoder.familiarity import learn_familiarity
from garden_models.gravity.decoder.network import GravityViewDecoder
from garden_models.gravity.decoder.uncertainty import calibrate
from garden_models.gravity.training.calibrated import Calibrated
from garden_models.gravity.training.shard import EvidenceShard
from garden_models.progress import Progress, silent


def calibrate_decoder(
    model: GravityViewDecoder, data: EvidenceShard, progress: Progress = silent
) -> Calibrated:
    """Decode every validation scene and fit the map from claims to errors."""
    found: list[Decoding] = []
    for k in range(len(data)):
        progress(k / len(data), f"scene {k} of {len(data)}")
        found.append(decode(model, data.scene(k)))
    claimed = np.array([f.claimed_rad for f in found])
    error = np.radians(
        [angle_between_deg(f.down_world, d) for f, d in zip(found, data.down, strict=True)]
    )
    familiar = learn_familiarity([f.tokens for f in found])
    return Calibrated(calibrate(claimed, error), familiar, claimed, error)
