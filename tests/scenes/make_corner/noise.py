"""Lattice noise in three dimensions, the raw material of every texture here.

All functions take points ``(n, 3)`` in any unit and a seed, and return values in 0..1.
They are pure functions of position, so the same place always gets the same paint.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]
Bits = NDArray[np.uint64]


PRIMES = tuple(np.uint64(p) for p in (0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9))


def lattice_terms(base: NDArray[np.int64], axis: int, reach: tuple[int, ...]) -> dict[int, Bits]:
    """Return, for each offset in ``reach``, the axis' part of the hash of ``base``."""
    column = base[..., axis].astype(np.uint64) * PRIMES[axis]
    return {k: column + np.uint64((k * int(PRIMES[axis])) % 2**64) for k in reach}


def scramble(h: Bits, seed: int) -> Bits:
    """Mix the bits of ``h`` and ``seed`` until none tells of another."""
    h = h + np.uint64((seed * 0x27D4EB2F165667C5) % 2**64)
    h ^= h >> np.uint64(29)
    h *= np.uint64(0xBF58476D1CE4E5B9)
    h ^= h >> np.uint64(32)
    h *= np.uint64(0x94D049BB133111EB)
    h ^= h >> np.uint64(29)
    return h


def hash01(cells: NDArray[np.int64], seed: int) -> Array:
    """Return a value in 0..1 for each integer cell ``(..., 3)``, as good as random."""
    x, y, z = (lattice_terms(cells, axis, (0,))[0] for axis in range(3))
    return (scramble(x ^ y ^ z, seed) >> np.uint64(11)).astype(np.float64) / float(2**53)


def value_noise(points: Array, seed: int) -> Array:
    """Return smooth noise with one random value a unit cell, ``(n,)`` in 0..1."""
    base = np.floor(points).astype(np.int64)
    t = points - base
    t = t * t * (3.0 - 2.0 * t)
    x, y, z = (lattice_terms(base, axis, (0, 1)) for axis in range(3))
    total = np.zeros(len(points))
    for i, j in itertools.product((0, 1), repeat=2):
        across = (t[:, 0] if i else 1.0 - t[:, 0]) * (t[:, 1] if j else 1.0 - t[:, 1])
        xy = x[i] ^ y[j]
        low = (scramble(xy ^ z[0], seed) >> np.uint64(40)).astype(np.float64)
        high = (scramble(xy ^ z[1], seed) >> np.uint64(40)).astype(np.float64)
        total += across * (low + t[:, 2] * (high - low))
    return np.asarray(total / float(2**24))


def fbm(points: Array, octaves: int, seed: int, gain: float = 0.6) -> Array:
    """Return a sum of octaves of noise, normalised to mean 0.5, ``(n,)`` in 0..1."""
    total = np.zeros(len(points))
    weight_sum = 0.0
    weight = 1.0
    for octave in range(octaves):
        total += weight * value_noise(points * 2.03**octave + 17.3 * octave, seed + octave)
        weight_sum += weight
        weight *= gain
    return np.asarray(np.clip(0.5 + 1.6 * (total / weight_sum - 0.5), 0.0, 1.0))


def cells(points: Array, seed: int) -> tuple[Array, Array, Array]:
    """Return Worley noise: distance to the nearest seed point, to the second nearest,
    and the nearest cell's own random value, each ``(n,)``; unit cells.

    Points that share one z get the flat pattern of that z: only its own layer counts.
    """
    base = np.floor(points).astype(np.int64)
    first = np.full(len(points), 9.0)
    second = np.full(len(points), 9.0)
    value = np.zeros(len(points))
    flat = bool(np.all(points[:, 2] == points[0, 2]))
    within = points - base
    x, y, z = (lattice_terms(base, axis, (-1, 0, 1)) for axis in range(3))
    for i, j, k in itertools.product((-1, 0, 1), (-1, 0, 1), (0,) if flat else (-1, 0, 1)):
        bits = scramble(x[i] ^ y[j] ^ z[k], seed)
        squared = np.zeros(len(points))
        for axis, offset in enumerate((i, j) if flat else (i, j, k)):
            place = ((bits >> np.uint64(21 * axis)) & np.uint64(0x1FFFFF)).astype(np.float64)
            squared += (place / float(2**21) + (offset - within[:, axis])) ** 2
        nearer = squared < first
        second = np.where(nearer, first, np.minimum(second, squared))
        mixed = (bits * PRIMES[0]) >> np.uint64(40)
        value = np.where(nearer, mixed.astype(np.float64) / float(2**24), value)
        first = np.where(nearer, squared, first)
    return np.sqrt(first), np.sqrt(second), value


def mix(a: Array, b: Array, t: Array) -> Array:
    """Blend colours ``a`` and ``b`` (each ``(3,)`` or ``(n, 3)``) by ``t`` ``(n,)``."""
    weight = np.clip(t, 0.0, 1.0)[:, None]
    return np.asarray(a) * (1.0 - weight) + np.asarray(b) * weight


def step(value: Array, edge: float, width: float) -> Array:
    """Return a smooth step of ``value`` from 0 to 1 around ``edge``."""
    t = np.clip((value - edge) / width + 0.5, 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))


def ramp(t: Array, *colours: str) -> Array:
    """Return ``(n, 3)`` sRGB colours 0..1 along the hex ``colours`` for ``t`` in 0..1."""
    table = np.array([hex_rgb(colour) for colour in colours])
    at = np.linspace(0.0, 1.0, len(table))
    return np.stack([np.interp(t, at, table[:, channel]) for channel in range(3)], axis=1)


def hex_rgb(colour: str) -> Array:
    """Return sRGB 0..1 of a colour such as ``b5651d``."""
    return np.array([int(colour[i : i + 2], 16) / 255.0 for i in (0, 2, 4)])
