"""Part a rotation to Gravity-View into its turn about gravity and what it leans."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from garden_models.geometry.rotation import angle_between_deg


def nearest_yaw(rotation_gv: Float[np.ndarray, "3 3"]) -> float:
    """Return the angle (rad) of the turn about y that is nearest to a rotation."""
    r = rotation_gv
    return float(np.arctan2(r[0, 2] - r[2, 0], r[0, 0] + r[2, 2]))


def tilt_deg(rotation_gv: Float[np.ndarray, "3 3"]) -> float:
    """Return the angle between the y axis (down) of an upright object and of Gravity-View."""
    return angle_between_deg(rotation_gv[:, 1], np.array([0.0, 1.0, 0.0]))
