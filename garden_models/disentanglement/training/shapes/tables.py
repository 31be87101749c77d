"""Build tables, desks, beds and benches: things with a top on legs."""

from __future__ import annotations

import numpy as np

from garden_models.disentanglement.training.shapes.shape import Draft, Shelf
from garden_models.disentanglement.training.shapes.solid import Solid, block, lathe, slab, tube

Rng = np.random.Generator


def legs(rng: Rng, width: float, depth: float, height: float) -> list[Solid]:
    """Return four legs, straight or splayed, square or round, with or without stretchers."""
    thick = rng.uniform(0.02, 0.06)
    splay = rng.choice([0.0, rng.uniform(0.0, 0.1)])
    inset = rng.uniform(0.6, 1.5) * thick
    x, z = width / 2 - inset, depth / 2 - inset
    taper = rng.uniform(0.5, 1.0)
    square = rng.random() < 0.5
    parts = []
    for sx in (-1, 1):
        for sz in (-1, 1):
            foot, head = (sx * (x + splay), 0.0, sz * (z + splay)), (sx * x, height, sz * z)
            if square and not splay:
                parts.append(slab(thick, height, thick, (sx * x, 0, sz * z)))
            else:
                parts.append(tube([foot, head], [thick / 2 * taper, thick / 2]))
    if rng.random() < 0.3:
        y = rng.uniform(0.1, 0.5) * height
        for sx in (-1, 1):
            parts.append(slab(thick / 2, thick / 2, 2 * z, (sx * x, y, 0)))
        parts.append(slab(2 * x, thick / 2, thick / 2, (0, y, 0)))
    return parts


def _top(width: float, depth: float, height: float, clearance: float = 2.0) -> Shelf:
    return Shelf(height, (-width / 2, width / 2), (-depth / 2, depth / 2), clearance)


def table(rng: Rng) -> Draft:
    """Return a rectangular table, dining or coffee."""
    height = rng.choice([rng.uniform(0.65, 0.8), rng.uniform(0.3, 0.5)])
    width, depth, thick = rng.uniform(0.7, 1.9), rng.uniform(0.5, 1.0), rng.uniform(0.015, 0.06)
    parts = [slab(width, thick, depth, (0, height - thick, 0))]
    parts += legs(rng, width, depth, height - thick)
    if rng.random() < 0.5:
        apron = rng.uniform(0.04, 0.1)
        for sz in (-1, 1):
            place = (0, height - thick - apron, sz * (depth / 2 - 0.05))
            parts.append(slab(width - 0.1, apron, 0.02, place))
    shelves = [_top(width, depth, height)]
    if rng.random() < 0.2:
        low = rng.uniform(0.15, 0.4) * height
        parts.append(slab(width - 0.12, 0.018, depth - 0.12, (0, low - 0.018, 0)))
        shelves.append(_top(width - 0.2, depth - 0.2, low, height - thick - low - 0.12))
    return Draft(parts, shelves)


def round_table(rng: Rng) -> Draft:
    """Return a round table on one foot or three legs."""
    height, radius = rng.uniform(0.4, 0.78), rng.uniform(0.22, 0.65)
    thick, stem = rng.uniform(0.015, 0.04), rng.uniform(0.02, 0.06)
    parts = [lathe([(0, height - thick), (radius, height - thick), (radius, height), (0, height)])]
    if rng.random() < 0.6:
        foot = radius * rng.uniform(0.4, 0.8)
        parts.append(
            lathe(
                [
                    (0, 0),
                    (foot, 0),
                    (foot, 0.02),
                    (stem, 0.06),
                    (stem, height - thick),
                    (0, height - thick),
                ]
            )
        )
    else:
        for angle in np.arange(3) * 2 * np.pi / 3:
            reach = radius * np.array([0.9, 0.5])
            points = [
                (r * np.cos(angle), y, r * np.sin(angle))
                for r, y in zip(reach, (0, height - thick), strict=True)
            ]
            parts.append(tube(points, stem / 2))
    half = radius * 0.68
    return Draft(parts, [_top(2 * half, 2 * half, height)])


def desk(rng: Rng) -> Draft:
    """Return a desk with a drawer block on one side and side panels or legs on the other."""
    width, depth, height = rng.uniform(1.0, 1.7), rng.uniform(0.5, 0.8), rng.uniform(0.7, 0.78)
    thick, drawers = rng.uniform(0.018, 0.04), rng.uniform(0.3, 0.45)
    side = rng.choice([-1, 1])
    parts = [slab(width, thick, depth, (0, height - thick, 0))]
    x = side * (width / 2 - drawers / 2 - 0.01)
    parts.append(slab(drawers, height - thick - 0.05, depth * 0.92, (x, 0.05, 0)))
    for k in range(int(rng.integers(2, 5))):
        y = 0.15 + 0.16 * k
        if y < height - 0.1:
            parts.append(slab(0.12, 0.012, 0.02, (x, y, depth * 0.46 + 0.01)))
    parts.append(slab(thick, height - thick, depth * 0.9, (-side * (width / 2 - thick), 0, 0)))
    if rng.random() < 0.6:
        parts.append(slab(width * 0.9, 0.3, 0.015, (0, height - thick - 0.3, -depth * 0.42)))
    return Draft(parts, [_top(width, depth, height)])


def bench(rng: Rng) -> Draft:
    """Return a bench of slats or of one board."""
    width, depth, height = rng.uniform(0.8, 1.6), rng.uniform(0.28, 0.45), rng.uniform(0.38, 0.5)
    thick, count = rng.uniform(0.02, 0.05), int(rng.integers(1, 5))
    board = depth / count
    parts = [
        slab(
            width,
            thick,
            board * (0.98 if count == 1 else 0.8),
            (0, height - thick, (i + 0.5) * board - depth / 2),
        )
        for i in range(count)
    ]
    return Draft(parts + legs(rng, width, depth, height - thick), [_top(width, depth, height)])


def stool(rng: Rng) -> Draft:
    """Return a stool, round or square, low or high."""
    height, width = rng.uniform(0.3, 0.75), rng.uniform(0.26, 0.42)
    thick = rng.uniform(0.02, 0.06)
    if rng.random() < 0.5:
        r, y = width / 2, height - thick
        seat = lathe([(0, y), (r, y), (r, height), (0, height)])
    else:
        seat = slab(width, thick, width, (0, height - thick, 0))
    half = 0.6 * width
    return Draft(
        [seat, *legs(rng, 0.8 * width, 0.8 * width, height - thick)], [_top(half, half, height)]
    )


def bed(rng: Rng) -> Draft:
    """Return a bed with head board, mattress and pillows."""
    width, length, height = rng.uniform(0.8, 1.8), rng.uniform(1.9, 2.1), rng.uniform(0.4, 0.55)
    frame = rng.uniform(0.2, 0.3)
    parts = [
        slab(width, frame - 0.08, length, (0, 0.08, 0)),
        slab(width - 0.06, height - frame, length - 0.06, (0, frame, 0)),
        block((-width / 2, 0, -length / 2 - 0.05), (width / 2, rng.uniform(0.7, 1.2), -length / 2)),
    ]
    for x in (-0.25, 0.25) if width > 1.2 else (0.0,):
        place = (x * width, height, -length / 2 + 0.3)
        parts.append(slab(0.45, 0.12, 0.3, place))
    for x in (-1, 1):
        for z in (-1, 1):
            parts.append(
                slab(0.06, 0.1, 0.06, (x * (width / 2 - 0.05), 0, z * (length / 2 - 0.05)))
            )
    free = Shelf(height, (-width / 2, width / 2), (-length / 2 + 0.6, length / 2 - 0.05))
    return Draft(parts, [free])


FAMILIES = {
    "table": table,
    "round_table": round_table,
    "desk": desk,
    "bench": bench,
    "stool": stool,
    "bed": bed,
}
