"""Build what is fixed in a room: floor, walls, ceiling, skirting, rug, sill, pictures."""

from __future__ import annotations

import numpy as np

from garden_models.disentanglement.training.scenes.room import Structure
from garden_models.disentanglement.training.shapes.shape import subdivided
from garden_models.disentanglement.training.shapes.solid import Solid, block

LONGEST_EDGE = 0.35


def room_structure(
    rng: np.random.Generator, width: float, depth: float, height: float
) -> tuple[Structure, ...]:
    """Return the structure of a room over x in 0..width and z in 0..depth, y down."""
    parts = [("floor", _sheet((0, 0, 0), (width, 0, 0), (0, 0, depth)))]
    walls = _walls(width, depth, height)
    for k in rng.permutation(4)[: int(rng.integers(2, 5))]:
        parts.append((f"wall {k}", walls[k]))
    if rng.random() < 0.5:
        parts.append(("ceiling", _sheet((0, -height, 0), (width, 0, 0), (0, 0, depth))))
    if rng.random() < 0.5:
        tall, thick = rng.uniform(0.05, 0.12), rng.uniform(0.008, 0.02)
        parts.append(("skirting", block((0, -tall, 0), (width, 0, thick))))
        parts.append(("skirting", block((0, -tall, 0), (thick, 0, depth))))
    if rng.random() < 0.4:
        size = rng.uniform(0.8, 2.0, 2)
        x, z = rng.uniform(0, 1, 2) * np.maximum([width, depth] - size, 0.1)
        parts.append(("rug", block((x, -0.004, z), (x + size[0], 0, z + size[1]))))
    for _ in range(int(rng.integers(0, 4))):
        x, y, w, h = rng.uniform([0, 1.0, 0.2, 0.2], [width - 0.8, 1.6, 0.8, 0.6])
        parts.append(("picture", block((x, -y - h, 0), (x + w, -y, rng.uniform(0.01, 0.04)))))
    if rng.random() < 0.3:
        y, deep = rng.uniform(0.8, 1.0), rng.uniform(0.1, 0.25)
        parts.append(("sill", block((0, -y - 0.03, 0.3), (deep, -y, min(depth, 2.0)))))
    return tuple(
        Structure(name, *subdivided(part.vertices, part.faces, LONGEST_EDGE))
        for name, part in parts
    )


def _walls(width: float, depth: float, height: float) -> list[Solid]:
    up = (0.0, -height, 0.0)
    return [
        _sheet((0, 0, 0), (width, 0, 0), up),
        _sheet((0, 0, 0), (0, 0, depth), up),
        _sheet((width, 0, 0), (0, 0, depth), up),
        _sheet((0, 0, depth), (width, 0, 0), up),
    ]


def _sheet(
    corner: tuple[float, float, float],
    along: tuple[float, float, float],
    across: tuple[float, float, float],
) -> Solid:
    """Return a rectangle of two triangles."""
    a, u, v = (np.array(p, float) for p in (corner, along, across))
    return Solid(np.stack([a, a + u, a + u + v, a + v]), np.array([[0, 1, 2], [0, 2, 3]]))
