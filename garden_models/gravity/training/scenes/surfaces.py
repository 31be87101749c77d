"""Describe a procedural scene by boxes, panels and ellipsoids, and cast rays at it.

The room's frame is z up, in metres. A face is counted by its primitive: six of a box, one of a
panel or an ellipsoid.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

NEAR = 0.02
FACES = 6
"""Faces counted for each primitive."""


@dataclass(frozen=True)
class Surfaces:
    """Oriented boxes, parallelograms and ellipsoids; ``turn`` are columns of axes.

    A panel is ``centre`` plus or minus ``half`` of its two ``edges`` (its rows, not unit).
    """

    box_centre: Float[np.ndarray, "b 3"]
    box_turn: Float[np.ndarray, "b 3 3"]
    box_half: Float[np.ndarray, "b 3"]
    panel_centre: Float[np.ndarray, "p 3"]
    panel_edges: Float[np.ndarray, "p 2 3"]
    ball_centre: Float[np.ndarray, "e 3"]
    ball_turn: Float[np.ndarray, "e 3 3"]
    ball_half: Float[np.ndarray, "e 3"]

    def __len__(self) -> int:
        return len(self.box_centre) + len(self.panel_centre) + len(self.ball_centre)


@dataclass(frozen=True)
class Hits:
    """What each ray meets first: its length in units of the ray (0: nothing) and the face
    (-1: nothing), ``primitive * FACES + face``.
    """

    distance: Float[np.ndarray, " n"]
    face: Int[np.ndarray, " n"]


def cast(
    surfaces: Surfaces, origin: Float[np.ndarray, "3"], rays: Float[np.ndarray, "n 3"]
) -> Hits:
    """Return the first hit of every ray from one origin."""
    best = np.full(len(rays), np.inf)
    face = np.full(len(rays), -1)
    squared = np.einsum("ni,ni->n", rays, rays)
    first = 0
    for k, (centre, turn, half) in enumerate(
        zip(surfaces.box_centre, surfaces.box_turn, surfaces.box_half, strict=True)
    ):
        near = _may_hit(centre - origin, float(np.linalg.norm(half)), rays, squared)
        t, side = _box(turn.T @ (origin - centre), rays[near] @ turn, half)
        _keep(best, face, near, t, (first + k) * FACES + side)
    first += len(surfaces.box_centre)
    for k, (centre, edges) in enumerate(
        zip(surfaces.panel_centre, surfaces.panel_edges, strict=True)
    ):
        near = np.arange(len(rays))
        t = _panel(origin - centre, rays, edges)
        _keep(best, face, near, t, np.full(len(rays), (first + k) * FACES))
    first += len(surfaces.panel_centre)
    for k, (centre, turn, half) in enumerate(
        zip(surfaces.ball_centre, surfaces.ball_turn, surfaces.ball_half, strict=True)
    ):
        near = _may_hit(centre - origin, float(half.max()), rays, squared)
        t = _ball((turn.T @ (origin - centre)) / half, rays[near] @ turn / half)
        _keep(best, face, near, t, np.full(len(near), (first + k) * FACES))
    hit = np.isfinite(best)
    return Hits(np.where(hit, best, 0.0), np.where(hit, face, -1))


def _keep(
    best: np.ndarray, face: np.ndarray, near: np.ndarray, t: np.ndarray, which: np.ndarray
) -> None:
    nearer = t < best[near]
    best[near[nearer]] = t[nearer]
    face[near[nearer]] = which[nearer]


def _may_hit(
    centre: np.ndarray, radius: float, rays: np.ndarray, squared: np.ndarray
) -> Int[np.ndarray, " m"]:
    """Return the rays that pass the bounding sphere."""
    away = float(centre @ centre)
    if away < radius**2:
        return np.arange(len(rays))
    along = rays @ centre
    return np.flatnonzero((along > 0) & (along * along >= (away - radius**2) * squared))


def _box(
    origin: np.ndarray, rays: np.ndarray, half: np.ndarray
) -> tuple[np.ndarray, Int[np.ndarray, " n"]]:
    """Return where rays enter a box that is parallel to the axes, and by which face."""
    with np.errstate(divide="ignore", invalid="ignore"):
        low, high = (-half - origin) / rays, (half - origin) / rays
    enter = np.nan_to_num(np.minimum(low, high), nan=-np.inf)
    leave = np.nan_to_num(np.maximum(low, high), nan=np.inf)
    axis = enter.argmax(axis=1)
    t = enter[np.arange(len(rays)), axis] if len(rays) else np.zeros(0)
    t = np.where((t > NEAR) & (t < leave.min(axis=1)), t, np.inf) if len(rays) else t
    side = 2 * axis + (rays[np.arange(len(rays)), axis] < 0) if len(rays) else axis
    return t, side


def _panel(origin: np.ndarray, rays: np.ndarray, edges: np.ndarray) -> np.ndarray:
    normal = np.cross(edges[0], edges[1])
    with np.errstate(divide="ignore", invalid="ignore"):
        t = -(normal @ origin) / (rays @ normal)
    dual = np.linalg.pinv(edges.T)  # coordinates along the two edges
    u, v = dual @ origin
    ray_u, ray_v = rays @ dual.T[:, 0], rays @ dual.T[:, 1]
    with np.errstate(invalid="ignore"):
        inside = (np.abs(u + t * ray_u) <= 0.5) & (np.abs(v + t * ray_v) <= 0.5) & (t > NEAR)
    return np.where(inside, t, np.inf)


def _ball(origin: np.ndarray, rays: np.ndarray) -> np.ndarray:
    a = np.einsum("ni,ni->n", rays, rays)
    b = rays @ origin
    inner = b * b - a * (origin @ origin - 1)
    with np.errstate(invalid="ignore"):
        t = (-b - np.sqrt(inner)) / a
        return np.where((inner > 0) & (t > NEAR), t, np.inf)
