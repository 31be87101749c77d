"""Define a furnished room: instances of shapes with poses, and the fixed structure."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from garden_models.disentanglement.training.shapes.shape import Shape

DIRECTIONS = 16
_ANGLES = np.arange(DIRECTIONS) * np.pi / DIRECTIONS
AXES: Float[np.ndarray, "2 d"] = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)])
"""Directions in (x, z) along which footprints are compared."""


@dataclass(frozen=True)
class Instance:
    """A shape that stands somewhere: its base centre (y down, metres) and yaw.

    ``rests_on`` is the index of the instance that carries it, -1 for the floor.
    """

    shape: Shape
    position: tuple[float, float, float]
    yaw_deg: float
    rests_on: int = -1

    @cached_property
    def vertices(self) -> Float[np.ndarray, "v 3"]:
        """Vertices in the room, metres."""
        c, s = np.cos(np.radians(self.yaw_deg)), np.sin(np.radians(self.yaw_deg))
        turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        return self.shape.vertices @ turn.T + np.array(self.position)

    @cached_property
    def box(self) -> Float[np.ndarray, "2 3"]:
        """Lowest and highest corner of its axis-parallel box."""
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @cached_property
    def shadow(self) -> Float[np.ndarray, "2 d"]:
        """Range of its footprint along each of ``AXES``."""
        along = self.vertices[:, [0, 2]] @ AXES
        return np.stack([along.min(axis=0), along.max(axis=0)])


@dataclass(frozen=True)
class Structure:
    """A fixed part of the room: floor, wall, ceiling, rug, skirting, picture."""

    name: str
    vertices: Float[np.ndarray, "v 3"]
    faces: Int[np.ndarray, "f 3"]


@dataclass(frozen=True)
class Room:
    """A furnished room, metres, y down; the floor is y = 0."""

    name: str
    instances: tuple[Instance, ...]
    structure: tuple[Structure, ...]


def gap(a: Instance, b: Instance) -> float:
    """Return a lower bound of the horizontal distance of two footprints (negative: overlap)."""
    return float(np.maximum(a.shadow[0] - b.shadow[1], b.shadow[0] - a.shadow[1]).max())


def overlap(a: Instance, b: Instance, least_gap: float = 0.0) -> bool:
    """Tell whether two instances share height and come nearer than ``least_gap`` sideways."""
    apart = a.box[1, 1] <= b.box[0, 1] + 1e-6 or b.box[1, 1] <= a.box[0, 1] + 1e-6
    return not apart and gap(a, b) < least_gap
