"""Paint the objects: sRGB 0..1 as a function of the place on the surface.

Every function takes points ``(n, 3)`` in the object's own metres (z up, base on z = 0)
and unit normals ``(n, 3)``. Colours vary at every scale, as worn paint does, so that
no part is a flat single colour.
"""

from __future__ import annotations

import numpy as np

from .noise import Array, cells, fbm, hash01, hex_rgb, mix, ramp, step, value_noise


def weathered(colour: Array, points: Array, seed: int, amount: float = 0.35) -> Array:
    """Vary the lightness of ``colour`` by blotches (cm) and grain (mm)."""
    blotch = fbm(points * 70.0, 4, seed) - 0.5
    grain = fbm(points * 420.0, 2, seed + 50) - 0.5
    lightness = 1.0 + amount * (blotch + 0.9 * grain)
    return np.asarray(np.clip(colour * lightness[:, None], 0.0, 1.0))


def jar(points: Array, normals: Array) -> Array:
    """Return a glazed jar: blue leaves and dots between bands, on crackled cream."""
    turn = np.arctan2(points[:, 1], points[:, 0])
    z = points[:, 2]
    radius = np.hypot(points[:, 0], points[:, 1])
    wobble = 0.004 * (value_noise(points * 40.0, 5) - 0.5)
    colour = ramp(fbm(points * 55.0, 4, 1), "d8c7a0", "efe6cf", "f6f1e4", "cdb98e")
    crackle_near, crackle_far, _ = cells(points * 75.0, 2)
    colour = mix(
        colour, hex_rgb("8a7552"), 0.55 * (1 - step(crackle_far - crackle_near, 0.04, 0.06))
    )

    # Leaves: Worley cells stretched along a slope that winds around the belly.
    winding = np.stack(
        [np.cos(turn) * 3.1, np.sin(turn) * 3.1, z * 34.0 + 1.2 * np.sin(3 * turn)], 1
    )
    near, far, value = cells(winding, 3)
    leaf = step(far - near, 0.16, 0.05) * (value > 0.28) * ((z > 0.028) & (z < 0.168))
    blue = ramp(
        0.6 * value + 0.4 * fbm(points * 160.0, 3, 9), "1c2f6e", "2f55a4", "3f7fb8", "22406f"
    )
    colour = mix(colour, blue, leaf)
    vein = 1 - step(np.abs(near - 0.22), 0.02, 0.03)
    colour = mix(colour, hex_rgb("e9dfc0"), 0.8 * leaf * vein)
    flower = (value > 0.80) * step(0.30 - near, 0.0, 0.04) * leaf
    colour = mix(colour, ramp(fbm(points * 200.0, 2, 4), "a8321f", "d9692e", "e8a23d"), flower)

    for low, high, tone in (
        (0.008, 0.024, "27406b"),
        (0.172, 0.186, "7d2f22"),
        (0.205, 0.213, "27406b"),
    ):
        band = step(z + wobble, low, 0.002) * (1 - step(z + wobble, high, 0.002))
        colour = mix(colour, weathered(np.tile(hex_rgb(tone), (len(z), 1)), points, 11), band)
        teeth = np.sin(turn * 34.0 + 2.0 * value_noise(points * 30.0, 6)) > 0.2
        middle = np.abs(z + wobble - (low + high) / 2) < 0.0035
        colour = mix(colour, hex_rgb("e6cf8e"), 0.9 * (teeth & middle))
    petals = np.sin(turn * 9.0 + 1.5 * np.sin(radius * 180.0))
    lid = step(petals, 0.1, 0.5) * (z > 0.216) * (z < 0.242)
    colour = mix(colour, ramp(fbm(points * 120.0, 3, 8), "1f3d7a", "3c72b0", "93b8d0"), lid)
    colour = mix(
        colour, ramp(fbm(points * 150.0, 3, 12), "7a5a1c", "c8922e", "e9cf78"), 1.0 * (z > 0.243)
    )
    return weathered(colour, points, 21, 0.18)


def house(points: Array, normals: Array) -> Array:
    """Return a house of uneven bricks, shingles, a door and windows."""
    x, y, z = points.T
    upright = np.abs(normals[:, 2]) < 0.3
    along = np.where(np.abs(normals[:, 0]) > 0.7, y, x)
    colour = bricks(points, along, np.array(["8f4a32", "b5653f", "a3553b", "c98a5e", "7b3f30"]))
    annex = (x > 0.0951) & upright
    colour = np.where(annex[:, None], planks(points, along), colour)

    gable = np.abs(normals[:, 0]) > 0.7
    wall = upright & (z < 0.14) & (np.abs(x) < 0.0951)
    for centre, low, high, half, kind in (
        (-0.055, 0.045, 0.092, 0.018, "window"),
        (0.055, 0.045, 0.092, 0.018, "window"),
        (0.0, 0.0, 0.078, 0.017, "door"),
    ):
        side = wall & ~gable & (y < 0 if kind == "door" else np.full(len(x), True))
        colour = opening(colour, points, x - centre, low, high, half, kind, side)
    colour = opening(colour, points, x, 0.045, 0.092, 0.026, "window", wall & ~gable & (y > 0))
    west = gable & (x < -0.09) & (x > -0.0955)
    colour = opening(colour, points, y - 0.028, 0.030, 0.080, 0.018, "window", west)
    colour = opening(colour, points, y + 0.030, 0.0, 0.075, 0.018, "door", west)
    colour = opening(
        colour, points, y, 0.118, 0.148, 0.014, "window", gable & (x > -0.0955) & (x < 0.0955)
    )
    colour = opening(colour, points, y, 0.018, 0.046, 0.020, "window", gable & (x > 0.14))

    roof = (normals[:, 2] > 0.3) & (z < 0.2315)
    colour = np.where(roof[:, None], shingles(points), colour)
    edge = (np.abs(x) > 0.0955) & gable & (x < 0.12) | (normals[:, 2] < -0.3)
    colour = np.where(edge[:, None], planks(points, z), colour)
    return weathered(colour, points, 40, 0.32)


def bricks(points: Array, along: Array, tones: Array, length: float = 0.017) -> Array:
    """Return bricks in courses of half their length; each brick has its own tone."""
    height = 0.5 * length
    course = np.floor(points[:, 2] / height)
    shifted = along / length + 0.5 * np.mod(course, 2)
    brick = np.floor(shifted)
    key = np.stack([brick, course, np.round(along * 0)], axis=1).astype(np.int64) + 1000
    palette = np.array([hex_rgb(t) for t in tones])
    value = hash01(key, 61)
    colour = palette[(value * len(palette)).astype(int)] * (0.75 + 0.5 * hash01(key, 62))[:, None]
    u, v = shifted - brick, points[:, 2] / height - course
    joint = np.maximum(np.abs(u - 0.5) - 0.44, np.abs(v - 0.5) - 0.40)
    mortar = ramp(fbm(points * 300.0, 2, 63), "a59a86", "d6cdb8")
    return mix(colour, mortar, step(joint, 0.0, 0.04))


def planks(points: Array, along: Array) -> Array:
    """Return painted boards 1.2 cm wide, worn to the wood here and there."""
    board = np.floor(along / 0.012).astype(np.int64)
    value = hash01(np.stack([board, board * 0, board * 0], axis=1) + 500, 71)
    paint = ramp(value, "2f6f62", "4b917c", "6fae95", "2a5f6b")
    wood = ramp(fbm(points * np.array([160.0, 160.0, 45.0]), 3, 72), "6b4a2a", "b98d57")
    colour = mix(paint, wood, step(fbm(points * 90.0, 4, 73), 0.62, 0.08))
    gap = np.abs(along / 0.012 - board - 0.5) > 0.44
    return mix(colour, hex_rgb("22302c"), 0.8 * gap)


def shingles(points: Array) -> Array:
    """Return overlapping round-ended shingles, every one of its own tone."""
    width, height = 0.017, 0.014
    down = -points[:, 2]
    row = np.floor(down / height)
    across = (
        points[:, 0] / width
        + 0.5 * np.mod(row, 2)
        + 0.12 * hash01(np.stack([row, row * 0, row * 0], 1).astype(np.int64) + 900, 81)
    )
    tile = np.floor(across)
    u, v = across - tile - 0.5, down / height - row
    belongs_above = v < 0.45 * (1.0 - np.sqrt(np.clip(1.0 - (2 * u) ** 2, 0.0, 1.0)))
    side = (points[:, 1] > 0).astype(np.int64)
    key = np.stack([tile + 3 * belongs_above, row - belongs_above, side], 1).astype(np.int64) + 3000
    value = hash01(key, 82)
    colour = ramp(value, "3b4452", "59657a", "8493a5", "6a5a60", "465a52", "a3a9a4")
    rim = np.abs(v - 0.45 * (1.0 - np.sqrt(np.clip(1.0 - (2 * u) ** 2, 0.0, 1.0)))) < 0.09
    lichen = step(fbm(points * 110.0, 4, 83), 0.66, 0.06)
    colour = mix(colour, ramp(value, "8f8a3a", "c2b457"), 0.8 * lichen)
    return mix(colour, hex_rgb("20242c"), 0.75 * rim)


def opening(
    colour: Array,
    points: Array,
    across: Array,
    low: float,
    high: float,
    half: float,
    kind: str,
    where: Array,
) -> Array:
    """Paint a framed window or door centred at ``across`` = 0 between two heights."""
    z = points[:, 2]
    beyond = np.maximum(np.abs(across) - half, np.maximum(low - z, z - high))
    frame = ramp(fbm(points * 250.0, 3, 91), "cfc3a2", "f3ecd9")
    if kind == "window":
        bars = np.minimum(np.abs(across), np.abs(z - (low + high) / 2)) < 0.0018
        glass = ramp(
            fbm(points * np.array([90.0, 90.0, 60.0]), 4, 92), "16222e", "3f5f78", "9db8c4"
        )
        fill = mix(glass, frame, 1.0 * bars)
    else:
        fill = ramp(
            fbm(points * np.array([300.0, 300.0, 40.0]), 4, 93), "3a1f16", "7a2e22", "a4503a"
        )
        knob = np.hypot(across - 0.6 * half, z - 0.45 * (low + high)) < 0.0028
        fill = mix(fill, hex_rgb("e3c15a"), 1.0 * knob)
    painted = mix(frame, fill, 1.0 * (beyond < -0.0035))
    return np.where((where & (beyond < 0.0))[:, None], painted, colour)


def duck(points: Array, normals: Array) -> Array:
    """Return a painted decoy: scaly feathers, barred wings, green head, orange bill."""
    x, y, z = points.T
    near, far, value = cells(points * np.array([85.0, 110.0, 110.0]), 101)
    tone = 0.55 * value + 0.45 * fbm(points * 240.0, 3, 102)
    flank = ramp(tone, "6d5236", "a9865a", "d8c19a", "efe3c8", "8b6a48")
    colour = mix(flank, hex_rgb("3a2a1c"), 0.8 * (1 - step(far - near, 0.10, 0.08)))

    wing_at = np.stack([x + 0.020, np.abs(y) - 0.050, z - 0.064], 1) / np.array(
        [0.070, 0.022, 0.034]
    )
    wing = (np.linalg.norm(wing_at, axis=1) < 1.12) & (np.abs(y) > 0.042)
    bars = 0.5 + 0.5 * np.sin((x + 0.7 * z) * 620.0 + 5.0 * value_noise(points * 60.0, 104))
    plumage = mix(
        ramp(tone, "20384f", "3b6a86", "7ca7b0"), hex_rgb("e8dcc0"), step(bars, 0.78, 0.3)
    )
    speculum = (x < -0.040) & (x > -0.066)
    plumage = np.where(speculum[:, None], ramp(tone, "2c2f7d", "4a59c4", "8f8fe0"), plumage)
    colour = np.where(wing[:, None], plumage, colour)

    tail = x < -0.088
    tail_bars = step(
        np.sin(np.arctan2(y, -x - 0.03) * 26.0 + 2.0 * fbm(points * 80.0, 2, 105)), 0.2, 0.5
    )
    colour = np.where(
        tail[:, None], mix(ramp(tone, "e6dcc4", "b59d74"), hex_rgb("2b211a"), tail_bars), colour
    )

    breast = (x > 0.045) & (z > 0.018)
    spots = step(0.28 - near, 0.0, 0.1)
    chest = mix(ramp(tone, "6e3220", "97482c", "b8673e"), hex_rgb("f0d9a8"), 0.85 * spots)
    colour = np.where(breast[:, None], chest, colour)
    collar = z + 0.12 * (x - 0.07) + 0.002 * np.sin(x * 300) > 0.113
    colour = np.where(collar[:, None], ramp(tone, "e9e4d4", "c9bfa5", "f7f3e6"), colour)
    head = z + 0.12 * (x - 0.07) > 0.121
    iridescent = ramp(
        0.5 * fbm(points * 130.0, 4, 106) + 0.5 * value,
        "0f3a2c",
        "1f6b4a",
        "4f9b5e",
        "1b4f5e",
        "97b060",
    )
    fine = 1 - step(far - near, 0.09, 0.08)
    colour = np.where(head[:, None], mix(iridescent, hex_rgb("0a1f1a"), 0.7 * fine), colour)

    eye = np.linalg.norm(np.stack([x - 0.098, np.abs(y) - 0.029, z - 0.154], 1), axis=1)
    colour = np.where((eye < 0.0085)[:, None], ramp(tone, "e8d9a0", "fff6d8"), colour)
    colour = np.where((eye < 0.0050)[:, None], ramp(tone, "0b0b0d", "2a2420"), colour)
    bill = (x > 0.1165) & (z < 0.149)
    colour = np.where(
        bill[:, None], ramp(fbm(points * 260.0, 4, 107), "a8541a", "e08a2c", "f3bd55"), colour
    )
    base = z < 0.012
    ground = ramp(fbm(points * 130.0, 4, 108), "33451f", "5f7a34", "97a552")
    colour = np.where(base[:, None], ground, colour)
    return weathered(colour, points, 110, 0.28)
