"""Detect that an object is its own mirror image in a vertical plane, from its seen parts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import cKDTree

SURFACE, EMPTY, UNKNOWN = 0, 1, 2
"""What is known of a place: seen surface, seen (or carved) empty, not seen."""

Look = Callable[[Float[np.ndarray, "n 3"]], np.ndarray]
"""Returns SURFACE, EMPTY or UNKNOWN for points in GV."""

LEAST_SCORE = 0.97
"""Share of checkable mirrored points that must meet a seen surface: a part that only one
side has is easily a twentieth of the surface."""

LEAST_CHECKED = 0.3
"""Share of telling mirrored points that must fall where something is known."""

LEAST_MOVE = 0.06
"""Points that a plane moves by less than this share of the width say nothing about it."""

LEVEL = 0.8
"""Neither do points on level faces (|normal y| above this) that meet their own face again."""

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
    seen = _Seen(seen_gv, _level(seen_gv), look, middle, LEAST_MOVE * width)
    step = 2.0 * OFFSET_REACH * width / (OFFSET_STEPS - 1)
    tried = [
        _judge(seen, yaw, shift)
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
                    plane = _judge(seen, yaw, shift)
                    if plane and plane.score > best.score:
                        best = plane
        if best.score >= LEAST_SCORE:
            return best
    return None


@dataclass(frozen=True)
class _Seen:
    """Seen points, which of them lie on level faces, and how to look up mirrored places."""

    points_gv: Float[np.ndarray, "n 3"]
    level: Bool[np.ndarray, " n"]
    look: Look
    middle: Float[np.ndarray, "3"]
    least_move: float


def _level(points_gv: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, " n"]:
    """Tell which points lie on level faces, by the plane through their neighbours."""
    count = min(12, len(points_gv))
    _, index = cKDTree(points_gv).query(points_gv, k=count)
    near = points_gv[index] - points_gv[index].mean(axis=1, keepdims=True)
    _, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", near, near))
    return np.abs(vectors[:, 1, 0]) > LEVEL


def _judge(seen: _Seen, yaw: float, shift: float) -> MirrorPlane | None:
    """Score a plane; None if too little of the mirrored points can be checked."""
    normal = np.array([np.cos(yaw), 0.0, np.sin(yaw)])
    offset = float(seen.middle @ normal) + shift
    moved = 2.0 * np.abs(seen.points_gv @ normal - offset) > seen.least_move
    state = seen.look(reflect(seen.points_gv, normal, offset))
    telling = moved & ~seen.level
    surface = int((telling & (state == SURFACE)).sum())
    empty = int((moved & (state == EMPTY)).sum())
    if surface + empty < max(LEAST_CHECKED * telling.sum(), 1):
        return None
    gain = float((state == UNKNOWN).mean())
    return MirrorPlane(normal, offset, surface / (surface + empty), gain)
