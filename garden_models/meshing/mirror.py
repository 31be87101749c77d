"""Detect that an object is its own mirror image in a vertical plane, from its seen parts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

SURFACE, EMPTY, UNKNOWN = 0, 1, 2
"""What is known of a place: seen surface, seen (or carved) empty, not seen."""

Look = Callable[[Float[np.ndarray, "n 3"]], np.ndarray]
"""Returns SURFACE, EMPTY or UNKNOWN for points in GV."""

LEAST_SCORE = 0.97
"""Share of checkable mirrored points that must meet a seen surface: a part that only one
side has is easily a twentieth of the surface."""

LEAST_CHECKED = 0.3
"""Share of mirrored points that must fall where something is known."""

YAW_STEP_DEG = 4.0
OFFSET_STEPS = 17
TRIED = 6
OFFSET_REACH = 0.16
"""Planes are tried up to this share of the object's width away from its middle; so many of the
most promising ones are refined."""


@dataclass(frozen=True)
class MirrorPlane:
    """The vertical plane ``normal . p = offset`` (GV; normal has no y).

    ``score`` is the share of checkable mirrored points that meet a seen surface, ``gain``
    the share of all mirrored points that fall where nothing was seen.
    """

    normal: Float[np.ndarray, "3"]
    offset: float
    score: float
    gain: float

    def reflect(self, points_gv: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        """Return the mirror images of points."""
        return reflect(points_gv, self.normal, self.offset)


def reflect(
    points_gv: Float[np.ndarray, "n 3"], normal: Float[np.ndarray, "3"], offset: float
) -> Float[np.ndarray, "n 3"]:
    """Return the points mirrored in the plane ``normal . p = offset`` (unit normal)."""
    return points_gv - 2.0 * (points_gv @ normal - offset)[:, None] * normal


def find_mirror_plane(seen_gv: Float[np.ndarray, "n 3"], look: Look) -> MirrorPlane | None:
    """Return the vertical mirror plane that shows most of what was not seen, if one holds.

    ``seen_gv`` are points evenly spread over the seen surface.
    """
    middle = 0.5 * (seen_gv.min(axis=0) + seen_gv.max(axis=0))
    width = float(np.linalg.norm(np.ptp(seen_gv[:, [0, 2]], axis=0)))
    step = 2.0 * OFFSET_REACH * width / (OFFSET_STEPS - 1)
    tried = [
        _judge(seen_gv, look, yaw, middle, shift)
        for yaw in np.radians(np.arange(0.0, 180.0, YAW_STEP_DEG))
        for shift in np.linspace(-OFFSET_REACH, OFFSET_REACH, OFFSET_STEPS) * width
    ]
    promising = [plane for plane in tried if plane and plane.score >= 0.9 * LEAST_SCORE]
    promising.sort(key=lambda plane: (-round(plane.gain, 1), -plane.score))
    for start in promising[:TRIED]:
        best = start
        for scale in (0.5, 0.25, 0.125):
            yaw0 = float(np.arctan2(best.normal[2], best.normal[0]))
            shift0 = best.offset - float(middle @ best.normal)
            for yaw in yaw0 + np.radians(YAW_STEP_DEG) * scale * np.array([-1, 0, 1]):
                for shift in shift0 + step * scale * np.array([-1, 0, 1]):
                    plane = _judge(seen_gv, look, yaw, middle, shift)
                    if plane and plane.score > best.score:
                        best = plane
        if best.score >= LEAST_SCORE:
            return best
    return None


def _judge(
    seen_gv: Float[np.ndarray, "n 3"],
    look: Look,
    yaw: float,
    middle: Float[np.ndarray, "3"],
    shift: float,
) -> MirrorPlane | None:
    """Score a plane; None if too little of the mirrored points can be checked."""
    normal = np.array([np.cos(yaw), 0.0, np.sin(yaw)])
    offset = float(middle @ normal) + shift
    state = look(reflect(seen_gv, normal, offset))
    surface, empty = int((state == SURFACE).sum()), int((state == EMPTY).sum())
    if surface + empty < LEAST_CHECKED * len(seen_gv):
        return None
    gain = float((state == UNKNOWN).mean())
    return MirrorPlane(normal, offset, surface / (surface + empty), gain)
