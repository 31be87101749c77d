"""Hold the settings of segmentation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Segment:
    """How a box becomes masks. Lengths are relative to the points' spacing or the box."""

    method: Literal["geometric", "sam3", "sam2"] = "geometric"
    """What finds the object's pixels: points and colours, or a model asked with boxes."""

    surroundings: float = 0.5
    """How far around the box (in boxes) points are looked at, for its support and rivals."""
    box_margin: float = 0.03
    """Share of half the box by which the object may stick out of it."""
    depth_before: float = 2.0
    depth_behind: float = 2.5
    """Points this many box diagonals before and behind the object's front are looked at."""
    max_nodes: int = 50_000
    """More points than this are thinned while they are divided, for time."""
    reach: float = 3.0
    """Points further apart than this many spacings are not joined."""
    colour_sigma: float = 20.0
    """CIE Lab difference over which two neighbours cease to be one thing."""
    crease_deg: float = 15.0
    """Bend of a concave crease over which two neighbours cease to be one thing."""
    max_tilt_deg: float = 8.0
    """How far a local support may lean: a cushion, a book, the error of gravity."""
    band_sigma: float = 3.0
    """Points this many noise levels off the support still belong to it."""
    min_support_score: float = 0.05
    """Product of shares (0..1) under which a surface does not count as carrying the object."""
    rounds: int = 2
    """How often views and points correct each other."""
