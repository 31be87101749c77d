"""Build shelves, cabinets, appliances and lamps that stand on the floor."""

from __future__ import annotations

import numpy as np

from garden_models.disentanglement.training.shapes.shape import Draft, Shelf
from garden_models.disentanglement.training.shapes.solid import Solid, lathe, slab, tube

Rng = np.random.Generator


def shelf(rng: Rng) -> Draft:
    """Return an open shelf of boards between sides or posts, with or without a back."""
    width, depth, height = rng.uniform(0.4, 1.4), rng.uniform(0.22, 0.42), rng.uniform(0.5, 2.0)
    thick, boards = rng.uniform(0.015, 0.03), max(2, int(height / rng.uniform(0.28, 0.45)))
    parts: list[Solid] = []
    shelves: list[Shelf] = []
    levels = np.linspace(thick + rng.uniform(0.0, 0.1), height, boards)
    for k, level in enumerate(levels):
        parts.append(slab(width - 2 * thick, thick, depth, (0, level - thick, 0)))
        free = float(levels[k + 1] - level - thick) if k + 1 < boards else 2.0
        inner = width / 2 - thick
        shelves.append(Shelf(float(level), (-inner, inner), (-depth / 2, depth / 2), free))
    if rng.random() < 0.7:
        for side in (-1, 1):
            parts.append(slab(thick, height, depth, (side * (width - thick) / 2, 0, 0)))
        if rng.random() < 0.5:
            parts.append(slab(width - 2 * thick, height, 0.008, (0, 0, -depth / 2 + 0.004)))
    else:
        for x in (-1, 1):
            for z in (-1, 1):
                place = (x * (width - thick) / 2, 0, z * (depth - thick) / 2)
                parts.append(slab(thick, height + 0.05, thick, place))
    return Draft(parts, shelves)


def cabinet(rng: Rng) -> Draft:
    """Return a closed cabinet with doors or drawers and handles."""
    width, depth, height = rng.uniform(0.4, 1.6), rng.uniform(0.35, 0.6), rng.uniform(0.45, 1.9)
    base = rng.uniform(0.0, 0.12)
    parts = [slab(width, height - base, depth, (0, base, 0))]
    if base > 0.03:
        for x in (-1, 1):
            for z in (-1, 1):
                parts.append(
                    slab(0.04, base, 0.04, (x * (width / 2 - 0.05), 0, z * (depth / 2 - 0.05)))
                )
    columns, rows = int(rng.integers(1, 4)), int(rng.integers(1, 5))
    w, h = width / columns, (height - base) / rows
    raised = rng.uniform(0.008, 0.02)
    for i in range(columns):
        for j in range(rows):
            across, up = (i + 0.5) * w - width / 2, base + j * h
            front = (across, up + 0.005, depth / 2 + raised / 2)
            parts.append(slab(w - 0.01, h - 0.01, raised, front))
            handle = (across, up + h / 2, depth / 2 + raised + 0.012)
            parts.append(slab(min(0.12, w / 2), 0.012, 0.024, handle))
    top = Shelf(height, (-width / 2, width / 2), (-depth / 2, depth / 2))
    return Draft(parts, [top] if height < 1.5 else [])


def appliance(rng: Rng) -> Draft:
    """Return a washing machine, fridge or oven: a box with a front."""
    width, depth = rng.uniform(0.5, 0.7), rng.uniform(0.5, 0.65)
    height = rng.choice([rng.uniform(0.8, 0.9), rng.uniform(1.4, 1.9)])
    parts = [slab(width, height - 0.03, depth, (0, 0.03, 0)), slab(width * 0.9, 0.03, depth * 0.9)]
    if height < 1:
        radius = rng.uniform(0.14, 0.2)
        ring = lathe([(0, 0), (radius, 0), (radius, 0.04), (radius * 0.7, 0.05), (0, 0.03)])
        parts.append(ring.turned(90, 0).moved(0, height * 0.5, depth / 2))
        parts.append(slab(width * 0.8, 0.06, 0.01, (0, height - 0.1, depth / 2)))
    else:
        split = rng.uniform(0.35, 0.65)
        for low, high in ((0.05, split), (split + 0.01, 0.99)):
            parts.append(
                slab(width, (high - low) * height, 0.04, (0, low * height, depth / 2 + 0.02))
            )
            handle = (width * 0.4, (low + high) / 2 * height, depth / 2 + 0.06)
            parts.append(slab(0.025, 0.25, 0.04, handle))
    top = Shelf(height, (-width / 2, width / 2), (-depth / 2, depth / 2))
    return Draft(parts, [top] if height < 1 else [])


def floor_lamp(rng: Rng) -> Draft:
    """Return a standing lamp with a shade, straight or bowed."""
    height, foot = rng.uniform(1.2, 1.8), rng.uniform(0.12, 0.18)
    stem = rng.uniform(0.008, 0.015)
    bow = rng.choice([0.0, rng.uniform(0.1, 0.4)])
    at = np.linspace(0, 1, 8)
    path = np.stack([bow * at**3, 0.02 + at * (height - 0.25), np.zeros(8)], axis=1)
    low, high, tall = rng.uniform(0.12, 0.22), rng.uniform(0.08, 0.15), rng.uniform(0.15, 0.3)
    wall = 0.004
    shade = lathe([(low - wall, 0), (low, 0), (high, tall), (high - wall, tall), (low - wall, 0)])
    return Draft([
        lathe([(0, 0), (foot, 0), (foot, 0.02), (0.02, 0.03), (0, 0.03)]),
        tube(path, stem),
        shade.moved(bow, height - 0.3, 0),
    ])  # fmt: skip


def coat_stand(rng: Rng) -> Draft:
    """Return a coat stand: a pole with feet and hooks."""
    height, radius = rng.uniform(1.5, 1.9), rng.uniform(0.015, 0.03)
    parts = [tube([(0, 0.1, 0), (0, height, 0)], radius)]
    feet, reach = int(rng.integers(3, 6)), rng.uniform(0.2, 0.32)
    for angle in np.arange(feet) * 2 * np.pi / feet:
        x, z = np.cos(angle), np.sin(angle)
        parts.append(tube([(0, 0.2, 0), (reach * x, 0.015, reach * z)], 0.014))
    for angle in np.arange(6) * np.pi / 3:
        x, z = np.cos(angle), np.sin(angle)
        y = height - 0.2 * (angle % 2)
        parts.append(
            tube([(0, y - 0.1, 0), (0.12 * x, y - 0.08, 0.12 * z), (0.16 * x, y, 0.16 * z)], 0.009)
        )
    return Draft(parts)


def bin_(rng: Rng) -> Draft:
    """Return a waste bin or a basket, open at the top."""
    low, high, height = rng.uniform(0.09, 0.16), rng.uniform(0.11, 0.2), rng.uniform(0.2, 0.5)
    wall = rng.uniform(0.004, 0.01)
    profile = [
        (0, 0),
        (low, 0),
        (high, height),
        (high - wall, height),
        (low - wall, wall),
        (0, wall),
    ]
    return Draft([lathe(profile, int(rng.choice([4, 6, 24])))])


FAMILIES = {
    "shelf": shelf,
    "cabinet": cabinet,
    "appliance": appliance,
    "floor_lamp": floor_lamp,
    "coat_stand": coat_stand,
    "bin": bin_,
}
