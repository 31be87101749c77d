"""The straight edges of a procedural scene, and what of them a view shows as segments."""

from __future__ import annotations

import itertools

import numpy as np
from jaxtyping import Float

from garden_models.geometry.camera import project
from garden_models.geometry.rigid import transform_points
from garden_models.gravity.training.scenes.surfaces import Surfaces

Ends = Float[np.ndarray, "n 2 3"]
NEAR = 0.05
ALONG = 9
"""Places along an edge at which it is looked for in the depth map."""
HIDDEN = 0.03
"""Relative depth by which an edge must be behind the surface seen to be hidden."""


def all_edges(surfaces: Surfaces, rng: np.random.Generator) -> Ends:
    """Return the edges of boxes and panels, and random lines drawn on some of their faces.

    Lines on faces run along them (boards, drawers, tiles) or anyhow (prints, shadows).
    """
    corners = [
        centre + (np.array(list(itertools.product((-1, 1), repeat=3))) * half) @ turn.T
        for centre, turn, half in zip(
            surfaces.box_centre, surfaces.box_turn, surfaces.box_half, strict=True
        )
    ]
    pairs = [(a, b) for a in range(8) for b in range(a) if bin(a ^ b).count("1") == 1]
    edges = [np.stack([c[a], c[b]]) for c in corners for a, b in pairs]
    for centre, turn, half in zip(
        surfaces.box_centre, surfaces.box_turn, surfaces.box_half, strict=True
    ):
        edges += _drawn(centre, turn, half, rng)
    for centre, (u, v) in zip(surfaces.panel_centre, surfaces.panel_edges, strict=True):
        for along, across in ((u, v), (v, u)):
            edges += [
                np.stack([centre + s * across / 2 - along / 2, centre + s * across / 2 + along / 2])
                for s in (-1, 1)
            ]
            if rng.uniform() < 0.3:
                for s in np.linspace(-0.45, 0.45, int(rng.integers(2, 9))):
                    middle = centre + s * across
                    edges.append(np.stack([middle - along / 2, middle + along / 2]))
        for _ in range(int(rng.integers(0, 3))):
            a, b = rng.uniform(-0.5, 0.5, (2, 2))
            edges.append(centre + np.stack([a[0] * u + a[1] * v, b[0] * u + b[1] * v]))
    return np.stack(edges) if edges else np.zeros((0, 2, 3))


def _drawn(
    centre: np.ndarray, turn: np.ndarray, half: np.ndarray, rng: np.random.Generator
) -> list[np.ndarray]:
    if rng.uniform() > 0.6:
        return []
    drawn = []
    for _ in range(int(rng.integers(1, 6))):
        axis, side = int(rng.integers(3)), rng.choice([-1.001, 1.001])
        first, second = rng.uniform(-0.9, 0.9, (2, 3))
        if rng.uniform() < 0.6:  # along the face
            moving = (axis + int(rng.integers(1, 3))) % 3
            second = np.where(np.arange(3) == moving, second, first)
        first[axis] = second[axis] = side
        drawn.append(centre + (np.stack([first, second]) * half) @ turn.T)
    return drawn


def seen_segments(
    edges: Ends,
    depth: Float[np.ndarray, "h w"],
    K: Float[np.ndarray, "3 3"],
    camera_from_room: Float[np.ndarray, "r 4"],
) -> Float[np.ndarray, "m 4"]:
    """Return the longest visible run of every edge in a view, in pixels (x0, y0, x1, y1)."""
    if not len(edges):
        return np.zeros((0, 4))
    ends = _in_front(transform_points(camera_from_room, edges.reshape(-1, 3)).reshape(-1, 2, 3))
    share = np.linspace(0, 1, ALONG)[None, :, None]
    points = ends[:, :1] * (1 - share) + ends[:, 1:] * share
    height, width = depth.shape
    pixels, z = project(points.reshape(-1, 3), K, np.eye(4))
    with np.errstate(invalid="ignore"):
        column, row = np.nan_to_num(np.floor(pixels), nan=-1).astype(int).T
    inside = (column >= 0) & (row >= 0) & (column < width) & (row < height) & (z > NEAR / 2)
    surface = depth[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]
    visible = inside & ((surface == 0) | (z < surface * (1 + HIDDEN)))
    first, last = _longest_run(visible.reshape(-1, ALONG))
    kept = last > first
    index = np.flatnonzero(kept)
    at = pixels.reshape(-1, ALONG, 2)
    return np.concatenate([at[index, first[kept]], at[index, last[kept]]], axis=1)


def _in_front(ends: Ends) -> Ends:
    """Cut segments at ``z = NEAR``; those wholly behind are put there as points."""
    a, b = ends[:, 0].copy(), ends[:, 1].copy()
    for one, other in ((a, b), (b, a)):
        behind = one[:, 2] < NEAR
        span = np.where(behind, other[:, 2] - one[:, 2], 1.0)
        share = np.where(np.abs(span) > 1e-9, (NEAR - one[:, 2]) / np.where(span == 0, 1, span), 0)
        moved = one + (other - one) * np.clip(share, 0, 1)[:, None]
        one[behind] = moved[behind]
    return np.stack([a, b], axis=1)


def _longest_run(visible: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the first and last index of the longest run of True in each row (0, 0: none)."""
    best = np.zeros((2, len(visible)), dtype=int)
    start = np.zeros(len(visible), dtype=int)
    for k in range(visible.shape[1]):
        start = np.where(visible[:, k], start, k + 1)
        longer = visible[:, k] & (k - start > best[1] - best[0])
        best[0] = np.where(longer, start, best[0])
        best[1] = np.where(longer, k, best[1])
    return best[0], best[1]
