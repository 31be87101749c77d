"""Build chairs, arm chairs and sofas."""

from __future__ import annotations

import numpy as np

from garden_models.disentanglement.training.shapes.shape import Draft, Shelf
from garden_models.disentanglement.training.shapes.solid import ellipsoid, lathe, slab, tube
from garden_models.disentanglement.training.shapes.tables import legs

Rng = np.random.Generator


def chair(rng: Rng) -> Draft:
    """Return a wooden chair: slats, bars or a board for a back, arms or none."""
    width, depth = rng.uniform(0.38, 0.5), rng.uniform(0.38, 0.48)
    seat, top = rng.uniform(0.42, 0.48), rng.uniform(0.75, 1.05)
    thick, post = rng.uniform(0.02, 0.05), rng.uniform(0.018, 0.035)
    lean = rng.uniform(0.0, 0.1)
    parts = [
        slab(width, thick, depth, (0, seat - thick, 0)),
        *legs(rng, width, depth, seat - thick),
    ]
    back, x = -depth / 2 + post, width / 2 - post
    for side in (-1, 1):
        parts.append(tube([(side * x, seat - thick, back), (side * x, top, back - lean)], post / 2))
    kind = rng.integers(3)
    if kind == 0:
        parts.append(
            slab(
                2 * x, (top - seat) * 0.6, 0.015, (0, seat + 0.35 * (top - seat), back - lean * 0.7)
            )
        )
    elif kind == 1:
        for k in range(int(rng.integers(2, 5))):
            share = 0.35 + 0.2 * k
            if share < 0.98:
                place = (0, seat + share * (top - seat) - 0.03, back - lean * share)
                parts.append(slab(2 * x, 0.05, 0.012, place))
    else:
        for place in np.linspace(-0.7, 0.7, int(rng.integers(3, 7))) * x:
            parts.append(tube([(place, seat - thick, back), (place, top, back - lean)], 0.007))
        parts.append(slab(2 * x + post, 0.05, post, (0, top - 0.05, back - lean)))
    if rng.random() < 0.3:
        arm = seat + rng.uniform(0.18, 0.25)
        for side in (-1, 1):
            parts.append(slab(0.04, 0.02, depth * 0.9, (side * x, arm, 0)))
            parts.append(
                tube([(side * x, seat, depth * 0.35), (side * x, arm, depth * 0.35)], 0.012)
            )
    return Draft(parts, [Shelf(seat, (-width * 0.4, width * 0.4), (-depth * 0.3, depth * 0.4))])


def office_chair(rng: Rng) -> Draft:
    """Return a swivel chair on a star of five arms."""
    seat, radius = rng.uniform(0.42, 0.52), rng.uniform(0.24, 0.32)
    width, depth = rng.uniform(0.44, 0.52), rng.uniform(0.42, 0.5)
    parts = [tube([(0, 0.07, 0), (0, seat - 0.06, 0)], rng.uniform(0.02, 0.035))]
    for angle in np.arange(5) * 2 * np.pi / 5:
        end = (radius * np.cos(angle), 0.06, radius * np.sin(angle))
        parts.append(tube([(0, 0.1, 0), end], [0.025, 0.014]))
        parts.append(ellipsoid((0.025, 0.03, 0.025), (end[0], 0.03, end[2]), segments=10))
    parts.append(ellipsoid((width / 2, 0.05, depth / 2), (0, seat - 0.05, 0), 0.5))
    height, lean = rng.uniform(0.4, 0.65), rng.uniform(0.02, 0.12)
    back = ellipsoid((width * 0.45, height / 2, 0.04), (0, 0, 0), 0.6).turned(-np.degrees(lean), 0)
    parts.append(back.moved(0, seat + height / 2 + 0.05, -depth / 2 - lean * 0.3))
    parts.append(tube([(0, seat - 0.08, -0.1), (0, seat + 0.1, -depth / 2 - 0.02)], 0.02))
    if rng.random() < 0.6:
        for side in (-1, 1):
            x = side * (width / 2 + 0.02)
            parts.append(tube([(x, seat - 0.06, 0), (x, seat + 0.2, 0)], 0.015))
            parts.append(slab(0.06, 0.03, 0.25, (x, seat + 0.2, 0)))
    return Draft(parts)


def sofa(rng: Rng) -> Draft:
    """Return a sofa or an arm chair, with cushions."""
    seats = int(rng.integers(1, 4))
    seat, depth = rng.uniform(0.36, 0.46), rng.uniform(0.75, 1.0)
    place, arm = rng.uniform(0.55, 0.75), rng.uniform(0.1, 0.25)
    width, top = seats * place + 2 * arm, rng.uniform(0.7, 0.95)
    base, back = rng.uniform(0.05, 0.15), rng.uniform(0.15, 0.25)
    parts = [
        slab(width, seat - 0.14 - base, depth, (0, base, 0)),
        slab(width, top - base, back, (0, base, -depth / 2 + back / 2)),
    ]
    for k in range(seats):
        x = (k + 0.5) * place - seats * place / 2
        cushion = ellipsoid((place / 2, 0.08, (depth - back) / 2), (0, 0, 0), 0.35)
        parts.append(cushion.moved(x, seat - 0.07, back / 2))
        rest = ellipsoid((place / 2, 0.2, 0.08), (0, 0, 0), 0.4)
        parts.append(rest.moved(x, seat + 0.2, -depth / 2 + back + 0.06))
    for side in (-1, 1):
        height = rng.uniform(0.5, 0.65)
        parts.append(slab(arm, height - base, depth, (side * (width / 2 - arm / 2), base, 0)))
        for z in (-1, 1):
            parts.append(
                slab(0.05, base, 0.05, (side * (width / 2 - 0.06), 0, z * (depth / 2 - 0.06)))
            )
    inner = width / 2 - arm
    return Draft(
        parts, [Shelf(seat + 0.01, (-inner, inner), (-depth / 2 + back + 0.2, depth / 2 - 0.05))]
    )


def pouf(rng: Rng) -> Draft:
    """Return an upholstered stool without legs."""
    radius, height = rng.uniform(0.2, 0.35), rng.uniform(0.28, 0.45)
    edge = rng.uniform(0.02, 0.08)
    if rng.random() < 0.5:
        profile = [
            (0, 0),
            (radius - edge / 2, 0),
            (radius, edge),
            (radius, height - edge),
            (radius - edge, height),
            (0, height),
        ]
        return Draft([lathe(profile)])
    return Draft(
        [ellipsoid((radius, height / 2, radius * rng.uniform(0.7, 1)), (0, height / 2, 0), 0.3)]
    )


FAMILIES = {"chair": chair, "office_chair": office_chair, "sofa": sofa, "pouf": pouf}
