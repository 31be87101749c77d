"""Generate the pictures on the room's surfaces as sRGB arrays ``(h, w, 3)`` in 0..1."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .noise import Array, cells, fbm, hash01, hex_rgb, mix, ramp, step, value_noise

Picture = Callable[[Array], Array]


def bake(paint: Picture, width_m: float, height_m: float, pitch_m: float, seed: int) -> Array:
    """Evaluate ``paint`` on a surface of the given size, row 0 at the top, ``(h, w, 3)``.

    ``paint`` gets points (u right, v up, seed) in metres and returns colours ``(n, 3)``.
    """
    columns, rows = round(width_m / pitch_m), round(height_m / pitch_m)
    u = (np.arange(columns) + 0.5) / columns * width_m
    out = np.empty((rows, columns, 3))
    for row in range(0, rows, 128):
        v = (1.0 - (np.arange(row, min(row + 128, rows)) + 0.5) / rows) * height_m
        grid = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
        points = np.column_stack([grid, np.full(len(grid), 3.7 * seed)])
        out[row : row + len(v)] = paint(points).reshape(len(v), columns, 3)
    return np.clip(out, 0.0, 1.0)


def boards(points: Array, width: float, length: float, tones: tuple[str, ...], seed: int) -> Array:
    """Return boards along u with their own tone, grain, pores and knots."""
    row = np.floor(points[:, 1] / width)
    zero = np.zeros(len(row))
    shift = hash01(np.stack([row, zero, zero], 1).astype(np.int64) + 70, seed)
    along = points[:, 0] / length + 3.0 * shift
    board = np.floor(along)
    key = np.stack([row, board, zero], 1).astype(np.int64) + 200
    own = hash01(key, seed + 1)
    local = points + np.stack([own * 31.0, own * 17.0, own * 5.0], 1)
    bend = 0.02 * (fbm(local * np.array([3.0, 9.0, 1.0]), 3, seed + 2) - 0.5)
    ring = local[:, 1] + bend
    knot_near, _, knot_value = cells(local * np.array([2.2, 7.0, 1.0]), seed + 3)
    ring = ring + 0.012 * np.exp(-((knot_near / 0.18) ** 2)) * (knot_value > 0.5)
    grain = 0.5 + 0.5 * np.sin(ring * (420.0 + 260.0 * own) + 4.0 * fbm(local * 14.0, 2, seed + 4))
    fibre = fbm(local * np.array([30.0, 420.0, 1.0]), 3, seed + 5)
    tone = 0.35 * own + 0.30 * grain + 0.45 * (fibre - 0.25)
    colour = ramp(tone, *tones) * (0.82 + 0.36 * own)[:, None]
    knot = step(0.16 - knot_near, 0.0, 0.08) * (knot_value > 0.5)
    colour = mix(colour, ramp(fbm(local * 160.0, 3, seed + 6), "2e1a0c", "5d3a1f"), 0.85 * knot)
    stain = step(fbm(points * 7.0, 4, seed + 7), 0.60, 0.25)
    colour = colour * (1.0 - 0.28 * stain)[:, None]
    fleck_near, _, fleck = cells(points * np.array([55.0, 75.0, 1.0]), seed + 8)
    speck = step(0.16 - fleck_near, 0.0, 0.06) * (fleck > 0.72)
    colour = mix(colour, ramp(fleck * 3.0 % 1.0, tones[0], "d9c4a0", "2b1c12"), 0.75 * speck)
    gap = np.minimum(
        np.abs(points[:, 1] / width - np.round(points[:, 1] / width)) * width,
        np.abs(along - np.round(along)) * length,
    )
    return mix(colour, hex_rgb("1d130b"), 0.85 * (1.0 - step(gap, 0.0016, 0.0014)))


def floor(points: Array) -> Array:
    """Return oak floor boards."""
    return boards(points, 0.12, 0.9, ("5a3a20", "8d6339", "b98a55", "d3ac74"), 200)


def rug(points: Array) -> Array:
    """Return a woven rug with irregular figures and a border; 2.2 m by 1.6 m."""
    u, v = points[:, 0], points[:, 1]
    edge = np.minimum(np.minimum(u, 2.2 - u), np.minimum(v, 1.6 - v))
    near, far, value = cells(points * np.array([11.0, 11.0, 1.0]), 301)
    colour = ramp(value, "5e1f24", "8e2f2b", "2b3a5c", "7a5a2e", "a8763a", "3f5346")
    rings = np.sin(near * 44.0 + 6.0 * value) > 0.25
    colour = mix(colour, ramp(1.0 - value, "d8c39a", "b98e55", "2a1d1c"), 0.8 * rings)
    colour = mix(colour, hex_rgb("1f1718"), 0.8 * (1.0 - step(far - near, 0.06, 0.04)))
    band = (edge < 0.16) & (edge > 0.03)
    teeth = cells(points * np.array([26.0, 26.0, 1.0]), 303)[2]
    colour = np.where(band[:, None], ramp(teeth, "22314f", "c7a25c", "7d2624", "e2d3ae"), colour)
    weave = 0.8 + 0.4 * fbm(points * np.array([260.0, 120.0, 1.0]), 2, 304)
    return colour * weave[:, None] * (0.8 + 0.4 * fbm(points * 6.0, 3, 305))[:, None]


def table_top(points: Array) -> Array:
    """Return a table of light boards with a printed cloth runner across it; 1.1 by 0.75 m."""
    wood = boards(points, 0.094, 0.8, ("7a5530", "b4864f", "d2aa72", "e6c896"), 400)
    u, v = points[:, 0], points[:, 1]
    # Rings left by cups, scratches and crumbs: what makes one place unlike another.
    for k in range(9):
        cell = np.array([[k, 4, 9], [k, 5, 9], [k, 6, 9]])
        a, b, c = hash01(cell, 410)
        radius = np.hypot(u - 1.1 * a, v - 0.75 * b)
        ring = 1.0 - step(np.abs(radius - 0.022 - 0.018 * c), 0.003, 0.003)
        wood = mix(wood, hex_rgb("4a2e17"), 0.55 * ring * fbm(points * 60.0, 3, 411 + k))
    scratch = np.abs(fbm(points * np.array([9.0, 22.0, 1.0]), 3, 430) - 0.5) < 0.008
    wood = mix(wood, hex_rgb("3b2613"), 0.6 * scratch)
    across = u - 0.55 + 0.05 * (v - 0.375)
    cloth_edge = 0.20 + 0.002 * np.sin(v * 210.0) - np.abs(across)
    cloth = runner(points)
    return np.where((cloth_edge > 0)[:, None], cloth, wood)


def runner(points: Array) -> Array:
    """Return printed cloth: leaves and berries of many tones on linen."""
    linen = ramp(fbm(points * np.array([330.0, 120.0, 1.0]), 3, 440), "7d6f55", "b3a585", "cbbf9f")
    warped = points + 0.03 * np.stack(
        [value_noise(points * 14.0, 441), value_noise(points * 14.0, 442), 0 * points[:, 0]], 1
    )
    near, far, value = cells(warped * np.array([24.0, 24.0, 1.0]), 443)
    leaf = step(far - near, 0.22, 0.06) * (value > 0.2)
    dye = ramp(value, "2f5d50", "6d8f4e", "b64b3a", "d79a3b", "3f4f7f", "8a4a6b")
    colour = mix(linen, dye * (0.75 + 0.5 * fbm(points * 110.0, 3, 444))[:, None], leaf)
    vein = 1.0 - step(np.abs(near - 0.25), 0.025, 0.03)
    colour = mix(colour, hex_rgb("efe6cf"), 0.7 * leaf * vein)
    dot_near, _, dot = cells(points * np.array([70.0, 70.0, 1.0]), 445)
    return mix(
        colour,
        ramp(dot, "3a2b4f", "8f2f2f", "e0b040"),
        step(0.22 - dot_near, 0.0, 0.08) * (dot > 0.5),
    )


def wallpaper(points: Array) -> Array:
    """Return hand-printed paper: sprigs scattered on mottled plaster tones."""
    ground = ramp(fbm(points * 5.0, 5, 500), "a8b5a0", "c6cdb4", "dad9c2", "b9bda0")
    ground = ground * (0.88 + 0.24 * fbm(points * 150.0, 3, 501))[:, None]
    warped = points + 0.05 * np.stack(
        [value_noise(points * 9.0, 502), value_noise(points * 9.0, 503), 0 * points[:, 0]], 1
    )
    near, far, value = cells(warped * np.array([13.0, 10.0, 1.0]), 504)
    leaf = step(far - near, 0.30, 0.06) * (value > 0.35)
    ink = ramp(value, "4d6b57", "6f8a5a", "a0603f", "54708a", "3f5548")
    colour = mix(ground, ink * (0.8 + 0.4 * fbm(points * 70.0, 3, 505))[:, None], 0.85 * leaf)
    petal = step(0.16 - near, 0.0, 0.05) * (value > 0.35)
    return mix(colour, ramp(value * 7.0 % 1.0, "d9b35a", "b5483c", "efe3c4"), petal)


def poster(seed: int) -> Picture:
    """Return a landscape print: sky, hills in layers, trees; each seed its own."""

    def paint(points: Array) -> Array:
        u, v = points[:, 0], points[:, 1]
        colour = ramp(
            v / 0.8 + 0.3 * (fbm(points * 9.0, 4, seed) - 0.5),
            "e8b36a",
            "d98a5a",
            "7a9cb8",
            "3c5f8f",
        )
        for layer in range(5):
            ridge = (
                0.55
                - 0.10 * layer
                + 0.16
                * (fbm(np.column_stack([u * (3 + layer), 0 * u, 0 * u + layer]), 4, seed + 1) - 0.5)
            )
            tone = fbm(points * (30.0 + 20.0 * layer), 4, seed + 2 + layer)
            hill = ramp(
                tone,
                *(
                    ("5b7a8a", "8fa7a8"),
                    ("46684f", "7d9a63"),
                    ("6b5a32", "b39a55"),
                    ("2f4a33", "6d8a45"),
                    ("3a2c22", "86603a"),
                )[layer],
            )
            colour = mix(colour, hill, step(ridge - v, 0.0, 0.004))
        near, _, value = cells(points * np.array([28.0, 22.0, 1.0]), seed + 9)
        tree = step(0.30 - near, 0.0, 0.06) * (value > 0.55) * (v < 0.4)
        return mix(colour, ramp(value, "14261a", "b0452a", "e3c65a"), tree)

    return paint


def books(points: Array) -> Array:
    """Return three shelves of book spines, 1 m wide and 0.9 m high."""
    u, v = points[:, 0], points[:, 1]
    shelf = np.floor(v / 0.30)
    slot = u / 0.034 + 0.45 * np.sin(u * 41.0 + shelf * 2.1) + 0.3 * np.sin(u * 97.0 + shelf)
    book = np.floor(slot)
    zero = np.zeros(len(u))
    key = np.stack([book, shelf, zero], 1).astype(np.int64) + 50
    a, b, c = hash01(key, 601), hash01(key, 602), hash01(key, 603)
    within = v - 0.30 * shelf
    top = 0.19 + 0.085 * b
    colour = ramp(a, "6b1f24", "b08a3c", "234b63", "3f5b3a", "7a6a58", "c9bfa8", "26262e", "8a3f5f")
    colour = colour * (0.7 + 0.6 * fbm(points * np.array([90.0, 40.0, 1.0]), 4, 604))[:, None]
    text_cells = cells(np.stack([u * 120.0, v * 60.0, key[:, 0] * 1.0], 1), 605)[2]
    title = (np.abs(within - 0.5 * top) < 0.25 * top) & (np.abs(slot - book - 0.5) < 0.25)
    colour = mix(colour, ramp(c, "e8d7a0", "f4efe0", "20180f"), 0.9 * (title & (text_cells > 0.45)))
    stripe = np.abs(within - (0.15 + 0.7 * c) * top) < 0.006
    colour = mix(colour, ramp(b, "d8b45a", "1d1a18"), 0.8 * stripe)
    joint = np.abs(slot - np.round(slot)) < 0.05
    colour = mix(colour, hex_rgb("0f0c0a"), 0.7 * joint)
    back = ramp(fbm(points * 40.0, 4, 606), "1c130c", "3a2718")
    colour = np.where((within > top)[:, None], back, colour)
    rail = (within < 0.022) | (v > 0.885) | (u < 0.02) | (u > 0.98)
    return np.where(
        rail[:, None], boards(points, 0.2, 2.0, ("3d2614", "6d4726", "946a3d"), 610), colour
    )
