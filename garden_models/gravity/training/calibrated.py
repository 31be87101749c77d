"""Define what validation scenes teach about a trained decoder (light to import)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from garden_models.gravity.decoder.familiarity import Familiarity
from garden_models.gravity.decoder.uncertainty import Calibration


@dataclass(frozen=True)
class Calibrated:
    """What validation scenes taught: the calibration, what is familiar, claims and errors
    (radians).
    """

    SCHEMA: ClassVar[str] = "garden.CalibratedGravityDecoder/1"

    calibration: Calibration
    familiarity: Familiarity
    claimed_rad: Float[np.ndarray, " n"]
    error_rad: Float[np.ndarray, " n"]
