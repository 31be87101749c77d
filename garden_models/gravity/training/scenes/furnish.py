"""Furnish random rooms: floors, walls, slanted roofs, furniture, clutter, leaning things."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from garden_models.geometry.rotation import axis_angle
from garden_models.gravity.training.scenes.surfaces import Surfaces

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class RoomKind:
    """Which structure a room may have; None leaves it to chance.

    ``planes`` False leaves out all that is large and flat; ``slanted`` adds roofs and ramps.
    """

    planes: bool | None = None
    slanted: bool | None = None


@dataclass
class _Parts:
    boxes: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = field(default_factory=list)
    panels: list[tuple[np.ndarray, np.ndarray]] = field(default_factory=list)
    balls: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = field(default_factory=list)


@dataclass(frozen=True)
class Room:
    """A furnished room, z up, metres; ``target`` is what photos may be taken of, ``inside``
    the half extents of the space for cameras.
    """

    surfaces: Surfaces
    target: Float[np.ndarray, "3"]
    inside: Float[np.ndarray, "2"]
    close_up: bool


def furnish(rng: np.random.Generator, kind: RoomKind = RoomKind()) -> Room:
    """Return a random room."""
    parts = _Parts()
    size = rng.uniform(2.4, 8.0, 2)
    bare = rng.uniform() < 0.12 if kind.planes is None else not kind.planes
    slanted = rng.uniform() < 0.2 if kind.slanted is None else kind.slanted
    crooked = np.radians(rng.choice([0.0, 0.3, 1.0], p=[0.5, 0.35, 0.15]))
    if not bare:
        _structure(parts, size, slanted, rng)
    tables = _furniture(parts, size, crooked, bare, rng)
    close_up = bool(tables) and rng.uniform() < 0.5
    target = np.array([*rng.uniform(-0.25, 0.25, 2) * size, rng.uniform(0.2, 1.2)])
    if close_up:
        centre, half, height = tables[int(rng.integers(len(tables)))]
        target = np.array([*centre[:2], height + 0.05])
        _clutter(parts, centre, half, height, int(rng.integers(2, 10)), crooked, rng)
    if slanted:
        _leaning(parts, target, close_up, rng)
    return Room(_surfaces(parts), target, size / 2, close_up)


def _structure(parts: _Parts, size: np.ndarray, slanted: bool, rng: np.random.Generator) -> None:
    height = rng.uniform(2.1, 3.4)
    if rng.uniform() < 0.9:
        slope = np.radians(rng.uniform(0, 5)) if rng.uniform() < 0.06 else 0.0
        lean = axis_angle(np.array([*rng.normal(size=2), 0.0]), slope)
        floor = np.array([[2 * size[0], 0, 0], [0, 2 * size[1], 0]]) @ lean.T
        parts.panels.append((np.zeros(3), floor))
    square = rng.uniform() < 0.85
    for k in range(4):
        if rng.uniform() < 0.35:
            continue
        yaw = k * np.pi / 2 + (0 if square else rng.normal(0, 0.3))
        out = np.array([np.cos(yaw), np.sin(yaw), 0])
        along = np.array([-out[1], out[0], 0])
        width = size[(k + 1) % 2]
        centre = out * size[k % 2] / 2 + UP * height / 2
        parts.panels.append((centre, np.stack([along * width * 1.05, UP * height])))
        for _ in range(int(rng.integers(0, 4))):  # doors, windows, pictures, shelves on the wall
            half = np.array([rng.uniform(0.01, 0.12), *rng.uniform([0.15, 0.2], [0.6, 1.0])])
            turn = np.stack([out, along, UP], axis=1)
            shift = along * rng.uniform(-0.4, 0.4) * width + UP * rng.uniform(-0.3, 0.4) * height
            parts.boxes.append((centre + shift - out * half[0], turn, half))
    if slanted and rng.uniform() < 0.6:
        pitch = axis_angle(
            rng.permutation([1.0, 0.0, 0.0]) * [1, 1, 0] + 1e-3, rng.uniform(0.3, 0.9)
        )
        roof = np.array([[size[0] * 1.2, 0, 0], [0, size[1] * 1.2, 0]]) @ pitch.T
        parts.panels.append((UP * height, roof))
    elif rng.uniform() < 0.4:
        ceiling = np.array([[size[0] * 1.05, 0, 0], [0, size[1] * 1.05, 0]])
        parts.panels.append((UP * height, ceiling))


def _furniture(
    parts: _Parts, size: np.ndarray, crooked: float, bare: bool, rng: np.random.Generator
) -> list[tuple[np.ndarray, np.ndarray, float]]:
    """Add furniture; return centre, half size and height of what things can stand on."""
    tops = []
    aligned = rng.uniform(0.3, 1.0)
    for _ in range(int(rng.integers(1, 11))):
        half = rng.uniform([0.15, 0.15, 0.1], [0.8, 0.5, 0.9]) * rng.choice([1.0, 0.6])
        yaw = rng.integers(4) * np.pi / 2 if rng.uniform() < aligned else rng.uniform(0, np.pi)
        centre = np.array([*rng.uniform(-0.45, 0.45, 2) * size, half[2]])
        if rng.uniform() < 0.25 and not bare:  # a table top without a body
            centre[2], half = rng.uniform(0.4, 0.9), half * [1.2, 1.2, 0.05]
        parts.boxes.append((centre, _lean(yaw, crooked, rng), half))
        height = centre[2] + half[2]
        tops.append((centre, half, height))
        if rng.uniform() < 0.5:
            _clutter(parts, centre, half, height, int(rng.integers(1, 5)), crooked, rng)
    for _ in range(int(rng.integers(2, 8) if bare else rng.integers(0, 3))):
        half = rng.uniform(0.1, 0.5, 3)
        centre = np.array([*rng.uniform(-0.4, 0.4, 2) * size, half[2]])
        parts.balls.append((centre, _any_turn(rng), half))
    return tops


def _clutter(
    parts: _Parts,
    centre: np.ndarray,
    half: np.ndarray,
    height: float,
    count: int,
    crooked: float,
    rng: np.random.Generator,
) -> None:
    for _ in range(count):
        at = centre[:2] + rng.uniform(-0.8, 0.8, 2) * half[:2]
        own = rng.uniform(0.02, 0.14, 3)
        place = np.array([*at, height + own[2]])
        chance = rng.uniform()
        if chance < 0.2:
            parts.balls.append((place, _any_turn(rng), own))
        elif chance < 0.4:
            parts.boxes.append((place, _any_turn(rng), own))
        else:
            parts.boxes.append((place, _lean(rng.uniform(0, np.pi), crooked, rng), own))


def _leaning(parts: _Parts, target: np.ndarray, close_up: bool, rng: np.random.Generator) -> None:
    """Add boards, ramps and easels: flat and large, but neither level nor upright."""
    unit = 0.3 if close_up else 1.0
    for _ in range(int(rng.integers(1, 4))):
        half = rng.uniform([0.3, 0.3, 0.01], [0.8, 0.8, 0.05]) * unit
        tilt = axis_angle(np.array([*rng.normal(size=2), 0.0]), rng.uniform(0.25, 1.2))
        place = target + rng.normal(0, 0.6, 3) * unit * [1, 1, 0.2]
        parts.boxes.append((place, tilt @ axis_angle(UP, rng.uniform(0, np.pi)), half))


def _lean(yaw: float, crooked: float, rng: np.random.Generator) -> np.ndarray:
    return axis_angle(rng.normal(size=3), crooked * rng.normal()) @ axis_angle(UP, yaw)


def _any_turn(rng: np.random.Generator) -> np.ndarray:
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else -q


def _surfaces(parts: _Parts) -> Surfaces:
    def stacked(
        items: Sequence[tuple[np.ndarray, ...]], shapes: tuple[tuple[int, ...], ...]
    ) -> list[np.ndarray]:
        columns = [[item[k] for item in items] for k in range(len(shapes))]
        return [np.reshape(c, (len(items), *s)) for c, s in zip(columns, shapes, strict=True)]

    solid = ((3,), (3, 3), (3,))
    return Surfaces(
        *stacked(parts.boxes, solid),
        *stacked(parts.panels, ((3,), (2, 3))),
        *stacked(parts.balls, solid),
    )
