"""Lay out an embedded token: what its entries are and how many (light to import)."""

from __future__ import annotations

import numpy as np

KIND = "embedded-views/1"
"""Raise the number when the meaning of a token's entry changes."""

SPHERE, HALF_SPHERE = 96, 64
NORMAL_KERNEL, LINE_KERNEL = np.radians(13.0), np.radians(7.0)
NORMAL_GATES = (np.radians(5.0), np.radians(14.0))
LINE_GATES = (np.radians(2.0), np.radians(7.0))
TILT_UNIT = 0.1
"""Radians that a tilt of 1 means."""
DAMPING = 0.02
"""Ridge on the tilts from lines, as a share of all lines."""
HEIGHTS, FACING_HEIGHTS, REACH = 12, 8, 2.0
FACING = np.cos(np.radians(15.0))
PARTS = {
    "normals": SPHERE,
    "lines": HALF_SPHERE,
    "normal tilts": 6 * len(NORMAL_GATES) * 3,
    "line tilts": 3 * len(LINE_GATES) * 3,
    "heights": 3 * HEIGHTS,
    "facing heights": 6 * FACING_HEIGHTS,
    "amounts": 2,
}
CAMERA = 9 + 3
TOKEN_WIDTH = 2 * sum(PARTS.values()) + 2 * CAMERA
