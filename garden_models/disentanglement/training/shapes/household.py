"""Build books, boxes, screens, lamps, plants and toys."""

from __future__ import annotations

import numpy as np

from garden_models.disentanglement.training.shapes.shape import Draft, Shelf
from garden_models.disentanglement.training.shapes.solid import ellipsoid, lathe, prism, slab, tube
from garden_models.disentanglement.training.shapes.tableware import vessel

Rng = np.random.Generator


def flat_top(width: float, depth: float, height: float) -> Shelf:
    """Return the upper side of a box as a place for other things."""
    return Shelf(height, (-width / 2, width / 2), (-depth / 2, depth / 2))


def book(rng: Rng) -> Draft:
    """Return a book, standing or lying."""
    width, height, thick = rng.uniform(0.1, 0.24), rng.uniform(0.15, 0.32), rng.uniform(0.008, 0.06)
    cover = 0.002
    if rng.random() < 0.5:
        parts = [slab(width - 0.004, thick - 2 * cover, height - 0.006, (0, cover, 0))]
        parts += [slab(width, cover, height, (0, y, 0)) for y in (0, thick - cover)]
    else:
        parts = [slab(thick - 2 * cover, height - 0.006, width - 0.004, (0, 0.003, 0))]
        parts += [slab(cover, height, width, (x * (thick - cover) / 2, 0, 0)) for x in (-1, 1)]
    return Draft(parts)


def carton(rng: Rng) -> Draft:
    """Return a box: cereal, shoes, parcel; closed, or open with flaps."""
    width, height, depth = rng.uniform(0.05, 0.45, 3)
    parts = [slab(width, height, depth)]
    shelves = [flat_top(width, depth, height)]
    if rng.random() < 0.25 and min(width, depth) > 0.15:
        wall, shelves = 0.005, []
        parts = [slab(width, wall, depth)]
        for side in (-1, 1):
            parts.append(slab(wall, height, depth, (side * (width - wall) / 2, 0, 0)))
            parts.append(slab(width, height, wall, (0, 0, side * (depth - wall) / 2)))
            flap = (
                slab(0.4 * width, wall, depth)
                .moved(0.2 * width, 0, 0)
                .turned(rng.uniform(-60, 20), 2)
            )
            parts.append(flap.moved(width / 2, height - 2 * wall, 0).turned(90 - 90 * side))
    return Draft(parts, shelves)


def milk_carton(rng: Rng) -> Draft:
    """Return a carton with a gable top."""
    width, height = rng.uniform(0.06, 0.1), rng.uniform(0.15, 0.25)
    half, eave = width / 2, height * 0.82
    outline = [
        (-half, 0.0),
        (half, 0.0),
        (half, eave),
        (0.002, height),
        (-0.002, height),
        (-half, eave),
    ]
    return Draft([prism(outline, width), slab(0.004, 0.02, width, (0, height - 0.002, 0))])


def can(rng: Rng) -> Draft:
    """Return a tin, a jar of paint, a candle or a roll."""
    radius, height = rng.uniform(0.02, 0.07), rng.uniform(0.04, 0.2)
    edge = radius * rng.uniform(0.02, 0.15)
    return Draft(
        [
            lathe(
                [
                    (0, 0),
                    (radius - edge, 0),
                    (radius, edge),
                    (radius, height - edge),
                    (radius - edge, height),
                    (0, height),
                ]
            )
        ]
    )


def ball(rng: Rng) -> Draft:
    """Return a ball, an egg or a fruit."""
    radius = rng.uniform(0.025, 0.14)
    return Draft([ellipsoid(radius * rng.uniform(0.8, 1.0, 3), (0, radius, 0))])


def monitor(rng: Rng) -> Draft:
    """Return a flat screen on a foot."""
    width, lift = rng.uniform(0.4, 1.1), rng.uniform(0.05, 0.16)
    height, thick = width * rng.uniform(0.52, 0.68), rng.uniform(0.015, 0.05)
    parts = [slab(width, height, thick, (0, lift, 0))]
    parts.append(slab(width * 0.4, 0.012, rng.uniform(0.15, 0.25)))
    parts.append(slab(0.06, lift + 0.1, 0.02, (0, 0, -thick / 2 - 0.01)))
    return Draft(parts)


def laptop(rng: Rng) -> Draft:
    """Return an opened laptop."""
    width, depth = rng.uniform(0.28, 0.38), rng.uniform(0.19, 0.26)
    lid = slab(width, depth, 0.006).turned(-rng.uniform(5, 40), 0)
    return Draft([slab(width, 0.016, depth), lid.moved(0, 0.012, -depth / 2)])


def keyboard(rng: Rng) -> Draft:
    """Return a keyboard with rows of keys."""
    width, depth = rng.uniform(0.27, 0.45), rng.uniform(0.1, 0.16)
    rows = [
        slab(width * 0.95, 0.01, depth / 7, (0, 0.012, (k - 2) * depth / 5.5)) for k in range(5)
    ]
    return Draft([slab(width, 0.014, depth), *rows])


def speaker(rng: Rng) -> Draft:
    """Return a loudspeaker or a radio: a box with round parts in front."""
    width, height, depth = rng.uniform(0.09, 0.3), rng.uniform(0.12, 0.4), rng.uniform(0.08, 0.25)
    parts = [slab(width, height, depth)]
    for share, size in ((0.3, 0.4), (0.72, 0.22)):
        r = size * min(width, height)
        disc = lathe([(0, 0), (r, 0), (r, 0.008), (r * 0.8, 0.004), (0, 0.002)]).turned(90, 0)
        parts.append(disc.moved(0, share * height, depth / 2))
    return Draft(parts, [flat_top(width, depth, height)])


def desk_lamp(rng: Rng) -> Draft:
    """Return a desk lamp with a jointed arm or a table lamp with a shade."""
    foot = rng.uniform(0.06, 0.1)
    parts = [lathe([(0, 0), (foot, 0), (foot, 0.015), (0.01, 0.025), (0, 0.025)])]
    if rng.random() < 0.5:
        elbow, end = (
            (-rng.uniform(0.05, 0.15), 0.25, 0),
            (rng.uniform(0.05, 0.2), rng.uniform(0.3, 0.45), 0),
        )
        parts.append(tube([(0, 0.02, 0), elbow], 0.007))
        parts.append(tube([elbow, end], 0.007))
        cone = lathe(
            [(0.055, 0), (0.058, 0), (0.02, 0.1), (0, 0.1), (0, 0.09), (0.017, 0.09), (0.055, 0)]
        )
        parts.append(cone.turned(rng.uniform(-40, 0), 2).moved(end[0], end[1] - 0.08, 0))
    else:
        height, low = rng.uniform(0.15, 0.35), rng.uniform(0.08, 0.16)
        parts.append(
            lathe([(0, 0.02), (0.03, 0.04), (0.045, height / 2), (0.012, height), (0, height)])
        )
        high = low * rng.uniform(0.5, 0.9)
        parts.append(
            lathe(
                [(low - 0.003, 0), (low, 0), (high, 0.16), (high - 0.003, 0.16), (low - 0.003, 0)]
            ).moved(0, height - 0.03, 0)
        )
    return Draft(parts)


def plant(rng: Rng) -> Draft:
    """Return a potted plant with stems and leaves."""
    radius, height = rng.uniform(0.04, 0.14), rng.uniform(0.07, 0.24)
    parts = [vessel([(radius * 0.75, 0), (radius, height)], 0.006, height * 0.8)]
    for _ in range(int(rng.integers(5, 16))):
        turn, reach = rng.uniform(0, 360), rng.uniform(0.05, 0.25)
        tall = height + rng.uniform(0.06, 0.4)
        parts.append(
            tube(
                [(0, height * 0.8, 0), (reach * 0.4, (height + tall) / 2, 0), (reach, tall, 0)],
                0.003,
                5,
            ).turned(turn)
        )
        leaf = ellipsoid((rng.uniform(0.03, 0.09), 0.003, rng.uniform(0.01, 0.035)), segments=8)
        parts.append(leaf.turned(rng.uniform(-50, 50), 2).moved(reach, tall, 0).turned(turn))
    return Draft(parts)


def picture_frame(rng: Rng) -> Draft:
    """Return a framed picture that leans back on a foot."""
    width, height, thick = rng.uniform(0.1, 0.3), rng.uniform(0.12, 0.3), rng.uniform(0.01, 0.02)
    lean = rng.uniform(8, 18)
    board = slab(width, height, thick).turned(-lean, 0)
    foot = slab(0.04, height * 0.8, 0.004).turned(20, 0)
    return Draft([board, foot.moved(0, 0, -height * 0.5)])


def clock(rng: Rng) -> Draft:
    """Return a round clock or globe on a foot."""
    radius, deep = rng.uniform(0.05, 0.16), rng.uniform(0.02, 0.05)
    parts = [slab(radius * 1.2, 0.015, max(0.05, deep * 1.4))]
    if rng.random() < 0.5:
        disc = lathe([(0, 0), (radius, 0), (radius, deep), (0, deep)]).turned(90, 0)
        parts.append(disc.moved(0, radius + 0.01, -deep / 2))
    else:
        parts.append(ellipsoid((radius, radius, radius), (0, radius + 0.06, 0)))
        parts.append(tube([(0, 0.01, 0), (0, 0.08, 0)], 0.01))
    return Draft(parts)


def toy_car(rng: Rng) -> Draft:
    """Return a toy car or lorry."""
    length, width = rng.uniform(0.07, 0.3), rng.uniform(0.4, 0.55)
    wide, wheel = length * width, length * rng.uniform(0.07, 0.12)
    parts = [slab(length, length * 0.18, wide, (0, wheel * 0.8, 0))]
    cabin = slab(length * rng.uniform(0.3, 0.6), length * 0.18, wide * 0.85)
    parts.append(cabin.moved(length * rng.uniform(-0.15, 0.15), wheel * 0.8 + length * 0.18, 0))
    for x in (-0.3, 0.3):
        for side in (-1, 1):
            disc = lathe([(0, 0), (wheel, 0), (wheel, wide * 0.15), (0, wide * 0.15)], 14).turned(
                90, 0
            )
            parts.append(disc.moved(x * length, wheel, side * wide * 0.45 - wide * 0.075))
    return Draft(parts)


def soft_toy(rng: Rng) -> Draft:
    """Return a sitting animal of ellipsoids: body, head, ears, limbs."""
    size = rng.uniform(0.06, 0.22)
    body = size * rng.uniform(0.8, 1.1, 3)
    head = size * rng.uniform(0.5, 0.75)
    parts = [ellipsoid(body * [0.8, 1, 0.7], (0, body[1], 0))]
    top = 2 * body[1] + head * 0.6
    parts.append(ellipsoid((head, head * 0.9, head * 0.9), (0, top, head * 0.2)))
    for side in (-1, 1):
        parts.append(
            ellipsoid(
                (head * 0.3, head * rng.uniform(0.3, 0.9), head * 0.15),
                (side * head * 0.7, top + head * 0.9, 0),
                segments=10,
            )
        )
        parts.append(
            ellipsoid(
                (size * 0.25, size * 0.6, size * 0.25),
                (side * body[0] * 0.85, body[1] * 1.2, size * 0.3),
                segments=10,
            )
        )
        parts.append(
            ellipsoid(
                (size * 0.28, size * 0.25, size * 0.6),
                (side * body[0] * 0.6, size * 0.25, size * 0.7),
                segments=10,
            )
        )
    return Draft(parts)


def toy_house(rng: Rng) -> Draft:
    """Return a house with a roof and perhaps an annex and a chimney."""
    width, depth, wall = rng.uniform(0.08, 0.25), rng.uniform(0.08, 0.2), rng.uniform(0.05, 0.16)
    roof = rng.uniform(0.04, 0.1)
    half = width / 2
    outline = [(-half, 0.0), (half, 0.0), (half, wall), (0.0, wall + roof), (-half, wall)]
    parts = [prism(outline, depth)]
    if rng.random() < 0.5:
        parts.append(slab(width * 0.5, wall * 0.6, depth * 0.6, (half + width * 0.25, 0, 0)))
    if rng.random() < 0.5:
        parts.append(slab(0.02, roof + 0.01, 0.02, (width * 0.25, wall, depth * 0.2)))
    return Draft(parts)


def blocks(rng: Rng) -> Draft:
    """Return building blocks stuck together: an arbitrary shape of boxes and cylinders."""
    unit = rng.uniform(0.02, 0.08)
    parts, at = [], np.zeros(3)
    for _ in range(int(rng.integers(2, 7))):
        w, h, d = unit * rng.uniform(0.6, 2.2, 3)
        if rng.random() < 0.7:
            parts.append(slab(w, h, d, at))
        else:
            parts.append(lathe([(0, 0), (w / 2, 0), (w / 2, h), (0, h)]).moved(*at))
        at = np.maximum(at + unit * rng.uniform([-0.8, 0.0, -0.8], [0.8, 1.2, 0.8]), [-9, 0, -9])
    return Draft(parts)


def tool(rng: Rng) -> Draft:
    """Return a hammer, a brush or a torch that lies flat."""
    length, thick = rng.uniform(0.15, 0.35), rng.uniform(0.01, 0.018)
    parts = [tube([(-length / 2, thick, 0), (length / 2, thick, 0)], thick)]
    if rng.random() < 0.5:
        parts.append(slab(thick * 2.4, thick * 2.4, rng.uniform(0.06, 0.12), (length / 2, 0, 0)))
    else:
        parts.append(
            tube(
                [(length / 2, thick, 0), (length / 2 + 0.05, thick * 1.2, 0)], [thick, thick * 1.6]
            )
        )
    return Draft(parts)


def shoe(rng: Rng) -> Draft:
    """Return a shoe or a boot."""
    length, width, tall = rng.uniform(0.2, 0.31), rng.uniform(0.08, 0.11), rng.uniform(0.06, 0.25)
    sole = slab(length, 0.02, width * 0.9)
    toe = ellipsoid((length * 0.35, 0.05, width / 2), (length * 0.15, 0.045, 0), 0.7)
    shaft = ellipsoid(
        (length * 0.22, tall / 2, width * 0.45), (-length * 0.27, tall / 2 + 0.02, 0), 0.5
    )
    return Draft([sole, toe, shaft])


def cushion(rng: Rng) -> Draft:
    """Return a cushion or a bag that lies or leans."""
    width, thick = rng.uniform(0.3, 0.55), rng.uniform(0.08, 0.2)
    pillow = ellipsoid((width / 2, thick / 2, width / 2 * rng.uniform(0.6, 1)), squareness=0.5)
    return Draft([pillow.turned(rng.choice([0, rng.uniform(40, 85)]), 0)])


FAMILIES = {
    "book": book, "carton": carton, "milk_carton": milk_carton, "can": can, "ball": ball,
    "monitor": monitor, "laptop": laptop, "keyboard": keyboard, "speaker": speaker,
    "desk_lamp": desk_lamp, "plant": plant, "picture_frame": picture_frame, "clock": clock,
    "toy_car": toy_car, "soft_toy": soft_toy, "toy_house": toy_house, "blocks": blocks,
    "tool": tool, "shoe": shoe, "cushion": cushion,
}  # fmt: skip
