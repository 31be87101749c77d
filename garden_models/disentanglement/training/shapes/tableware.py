"""Build cups, bowls, plates, bottles, pots and cutlery."""

from __future__ import annotations

import numpy as np

from garden_models.disentanglement.training.shapes.shape import Draft, Shelf
from garden_models.disentanglement.training.shapes.solid import Solid, ellipsoid, lathe, slab, tube

Rng = np.random.Generator
Profile = list[tuple[float, float]]


def vessel(outside: Profile, wall: float, floor: float) -> Solid:
    """Return an open vessel from its outer profile (radius, height), bottom to rim."""
    inside = [(max(r - wall, 0.0), max(h, floor)) for r, h in reversed(outside)]
    return lathe([(0.0, outside[0][1]), *outside, *inside, (0.0, floor)])


def handle(radius: float, low: float, high: float, reach: float, thick: float) -> Solid:
    """Return a bowed handle on the outside of a vessel, towards +x."""
    at = np.linspace(0, np.pi, 10)
    y = low + (high - low) * (1 - np.cos(at)) / 2
    return tube(np.stack([radius - thick / 2 + reach * np.sin(at), y, 0 * at], axis=1), thick / 2)


def bulged(rng: Rng, low: float, high: float, height: float, bulge: float) -> Profile:
    """Return a smooth profile between two radii that bulges in between."""
    at = np.linspace(0, 1, 9)
    middle = rng.uniform(0.35, 0.65)
    radius = low + (high - low) * at + bulge * np.exp(-(((at - middle) / 0.25) ** 2))
    return [(float(r), float(h)) for r, h in zip(radius, at * height, strict=True)]


def mug(rng: Rng) -> Draft:
    """Return a mug with a handle."""
    radius, height = rng.uniform(0.033, 0.048), rng.uniform(0.075, 0.12)
    outside = bulged(rng, radius * rng.uniform(0.8, 1), radius, height, rng.uniform(-0.003, 0.008))
    parts = [vessel(outside, 0.004, 0.006)]
    low, high = rng.uniform(0.15, 0.3) * height, rng.uniform(0.7, 0.9) * height
    parts.append(
        handle(radius * 0.97, low, high, rng.uniform(0.02, 0.035), rng.uniform(0.007, 0.012))
    )
    return Draft(parts)


def cup_and_saucer(rng: Rng) -> Draft:
    """Return a tea cup on its saucer."""
    radius, height, plate = (
        rng.uniform(0.038, 0.05),
        rng.uniform(0.05, 0.07),
        rng.uniform(0.07, 0.085),
    )
    cup = vessel([(radius * 0.5, 0), (radius * 0.85, height * 0.4), (radius, height)], 0.003, 0.004)
    saucer = vessel([(plate * 0.6, 0), (plate, 0.016)], 0.004, 0.004)
    loop = handle(radius * 0.9, height * 0.35, height * 0.9, 0.02, 0.006)
    return Draft([saucer, cup.moved(0, 0.005, 0), loop.moved(0, 0.005, 0)])


def bowl(rng: Rng) -> Draft:
    """Return a bowl."""
    radius, height, wall = (
        rng.uniform(0.06, 0.16),
        rng.uniform(0.04, 0.1),
        rng.uniform(0.003, 0.007),
    )
    foot, power = rng.uniform(0.35, 0.6), rng.uniform(0.35, 0.7)
    at = np.linspace(0, 1, 8)
    outside = [(radius * (foot + (1 - foot) * a**power), height * a) for a in at]
    return Draft([vessel([(float(r), float(h)) for r, h in outside], wall, 0.006)])


def plate(rng: Rng) -> Draft:
    """Return a plate, or a stack of them."""
    radius, height = rng.uniform(0.08, 0.15), rng.uniform(0.012, 0.03)
    outside = [(radius * 0.6, 0.0), (radius * 0.65, height * 0.4), (radius, height)]
    one = vessel(outside, 0.004, 0.004)
    count = 1 if rng.random() < 0.75 else int(rng.integers(2, 9))
    return Draft([one.moved(0, 0.007 * k, 0) for k in range(count)])


def bottle(rng: Rng) -> Draft:
    """Return a bottle with a neck and perhaps a cap."""
    radius, height = rng.uniform(0.028, 0.05), rng.uniform(0.16, 0.34)
    neck, shoulder = radius * rng.uniform(0.25, 0.45), rng.uniform(0.5, 0.75)
    profile = [
        (0, 0),
        (radius, 0),
        (radius, shoulder * height),
        (neck * 1.3, (shoulder + 0.17) * height),
    ]
    profile += [(neck, 0.9 * height), (neck, height), (0, height)]
    parts = [lathe(profile)]
    if rng.random() < 0.5:
        parts.append(
            lathe([(0, 0), (neck * 1.25, 0), (neck * 1.25, 0.02), (0, 0.02)]).moved(
                0, height - 0.015, 0
            )
        )
    return Draft(parts)


def wine_glass(rng: Rng) -> Draft:
    """Return a glass on a stem."""
    foot, stem, height = (
        rng.uniform(0.03, 0.042),
        rng.uniform(0.003, 0.005),
        rng.uniform(0.14, 0.24),
    )
    bowl_at, radius = rng.uniform(0.4, 0.55) * height, rng.uniform(0.03, 0.05)
    profile = [
        (0, 0),
        (foot, 0),
        (foot, 0.003),
        (stem, 0.01),
        (stem, bowl_at),
        (radius, bowl_at + 0.4 * (height - bowl_at)),
    ]
    profile += [
        (radius * 0.8, height),
        (radius * 0.8 - 0.002, height),
        (radius - 0.003, bowl_at + 0.4 * (height - bowl_at)),
        (0, bowl_at + 0.01),
    ]
    return Draft([lathe(profile)])


def tumbler(rng: Rng) -> Draft:
    """Return a drinking glass or a beaker without a handle."""
    radius, height = rng.uniform(0.028, 0.045), rng.uniform(0.07, 0.16)
    outside = [(radius * rng.uniform(0.65, 1), 0.0), (radius, height)]
    return Draft([vessel(outside, 0.003, 0.008)])


def vase(rng: Rng) -> Draft:
    """Return a vase."""
    height, radius = rng.uniform(0.14, 0.45), rng.uniform(0.03, 0.08)
    outside = bulged(
        rng, radius, radius * rng.uniform(0.5, 1.2), height, radius * rng.uniform(-0.4, 1)
    )
    return Draft([vessel(outside, 0.005, 0.01)])


def jar(rng: Rng) -> Draft:
    """Return a lidded jar."""
    height, radius = rng.uniform(0.08, 0.22), rng.uniform(0.035, 0.075)
    outside = bulged(rng, radius, radius * 0.85, height, radius * rng.uniform(0, 0.4))
    lid = radius * 0.95
    cap = lathe([(0, 0), (lid, 0), (lid, 0.015), (0.01, 0.025), (0.012, 0.04), (0, 0.045)])
    return Draft([lathe([(0, 0), *outside, (0, height)]), cap.moved(0, height, 0)])


def teapot(rng: Rng) -> Draft:
    """Return a teapot or a kettle: belly, spout, handle at the side or on top."""
    radius, height = rng.uniform(0.06, 0.1), rng.uniform(0.09, 0.16)
    outside = bulged(rng, radius * 0.7, radius * 0.5, height, radius * 0.45)
    parts = [lathe([(0, 0), *outside, (0, height)])]
    parts.append(ellipsoid((0.012, 0.014, 0.012), (0, height + 0.01, 0), segments=10))
    tip = (-radius * 1.8, height * 0.95, 0)
    parts.append(
        tube(
            [(-radius * 0.8, height * 0.35, 0), (-radius * 1.4, height * 0.6, 0), tip],
            [0.02, 0.013, 0.009],
        )
    )
    if rng.random() < 0.6:
        parts.append(handle(radius * 0.9, height * 0.2, height * 0.9, 0.05, 0.012))
    else:
        at = np.linspace(0, np.pi, 10)
        bow = np.stack([radius * 0.7 * np.cos(at), height + 0.07 * np.sin(at), 0 * at], axis=1)
        parts.append(tube(bow, 0.006))
    return Draft(parts)


def pot(rng: Rng) -> Draft:
    """Return a cooking pot with two handles, or a pan with one."""
    radius, height = rng.uniform(0.08, 0.15), rng.uniform(0.04, 0.18)
    parts = [vessel([(radius * 0.92, 0), (radius, 0.01), (radius, height)], 0.004, 0.005)]
    if height < 0.08:
        reach = rng.uniform(0.14, 0.22)
        parts.append(tube([(radius, height * 0.8, 0), (radius + reach, height + 0.02, 0)], 0.011))
    else:
        for turn in (0, 180):
            ear = handle(0, -0.04, 0.04, 0.035, 0.01).turned(90, 0)
            parts.append(ear.moved(radius, height * 0.8, 0).turned(turn))
        if rng.random() < 0.5:
            lid = [(0, 0), (radius, 0), (radius, 0.006), (0.02, 0.03), (0.02, 0.05), (0, 0.05)]
            parts.append(lathe(lid).moved(0, height, 0))
    return Draft(parts)


def pitcher(rng: Rng) -> Draft:
    """Return a jug with a handle and a lip."""
    radius, height = rng.uniform(0.045, 0.075), rng.uniform(0.16, 0.28)
    outside = bulged(rng, radius * 0.8, radius * 0.7, height, radius * 0.4)
    lip = tube([(-radius * 0.6, height - 0.03, 0), (-radius - 0.015, height, 0)], [0.02, 0.012])
    return Draft(
        [
            vessel(outside, 0.004, 0.008),
            handle(radius * 0.85, height * 0.25, height * 0.85, 0.045, 0.014),
            lip,
        ]
    )


def cutlery(rng: Rng) -> Draft:
    """Return a spoon, fork or knife that lies flat."""
    length, width = rng.uniform(0.14, 0.24), rng.uniform(0.006, 0.012)
    parts = [slab(length * 0.65, 0.003, width, (-length * 0.18, 0, 0))]
    kind = rng.integers(3)
    if kind == 0:
        parts.append(ellipsoid((length * 0.17, 0.005, 0.02), (length * 0.3, 0.005, 0), segments=14))
    elif kind == 1:
        for z in np.linspace(-0.009, 0.009, 4):
            parts.append(slab(length * 0.2, 0.002, 0.002, (length * 0.35, 0, float(z))))
        parts.append(slab(length * 0.12, 0.003, 0.022, (length * 0.2, 0, 0)))
    else:
        parts.append(slab(length * 0.4, 0.002, 0.02, (length * 0.32, 0, 0)))
    return Draft(parts)


def tray(rng: Rng) -> Draft:
    """Return a tray or a chopping board."""
    width, depth, thick = rng.uniform(0.25, 0.5), rng.uniform(0.18, 0.35), rng.uniform(0.006, 0.025)
    parts = [slab(width, thick, depth)]
    if rng.random() < 0.5:
        rim = rng.uniform(0.02, 0.05)
        for side in (-1, 1):
            parts.append(slab(width, rim, 0.008, (0, 0, side * depth / 2)))
            parts.append(slab(0.008, rim, depth, (side * width / 2, 0, 0)))
    return Draft(
        parts, [Shelf(thick, (-width * 0.45, width * 0.45), (-depth * 0.45, depth * 0.45))]
    )


FAMILIES = {
    "mug": mug,
    "cup_and_saucer": cup_and_saucer,
    "bowl": bowl,
    "plate": plate,
    "bottle": bottle,
    "wine_glass": wine_glass,
    "tumbler": tumbler,
    "vase": vase,
    "jar": jar,
    "teapot": teapot,
    "pot": pot,
    "pitcher": pitcher,
    "cutlery": cutlery,
    "tray": tray,
}
