"""Cut a labelled cloud around one instance out of a room (paper, supplement B.1).

The instance's gravity-aligned box is expanded at random, all triangles that reach into it are
collected, and points are drawn from them in proportion to area. A point is positive if its
triangle is the instance's.

Where an instance presses on what carries it, both surfaces are the same: no photo sees a
point there, and whose it is has no answer. Such points are left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from garden_models.disentanglement.training.pair import Condition, LabelledCloud
from garden_models.disentanglement.training.pairs_config import CropConfig
from garden_models.disentanglement.training.scenes.room import Room
from garden_models.disentanglement.triangles import sample_triangles

PRESSED = 0.0008
"""Metres within which a resting base and its carrier are one surface."""


@dataclass(frozen=True)
class RoomTriangles:
    """All triangles of a room, turned by some yaw; ``owner`` is -1 for the structure."""

    room: Room
    turn: Float[np.ndarray, "3 3"]

    @cached_property
    def corners(self) -> Float[np.ndarray, "t 3 3"]:
        """Corners, metres, y down."""
        parts = [i.vertices[i.shape.faces] for i in self.room.instances]
        parts += [s.vertices[s.faces] for s in self.room.structure]
        return np.asarray(np.concatenate(parts) @ self.turn.T)

    @cached_property
    def owner(self) -> Int[np.ndarray, " t"]:
        """Index of the instance of each triangle."""
        counts = [len(i.shape.faces) for i in self.room.instances]
        counts += [len(s.faces) for s in self.room.structure]
        number = len(self.room.instances)
        owners = [*range(number), *([-1] * len(self.room.structure))]
        return np.repeat(owners, counts)

    @cached_property
    def bounds(self) -> tuple[Float[np.ndarray, "t 3"], Float[np.ndarray, "t 3"]]:
        """Lowest and highest corner of each triangle."""
        return self.corners.min(axis=1), self.corners.max(axis=1)


def turned(room: Room, yaw: float) -> RoomTriangles:
    """Return a room's triangles turned about gravity by ``yaw`` (radians)."""
    c, s = np.cos(yaw), np.sin(yaw)
    return RoomTriangles(room, np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]))


def is_target(room: Room, index: int, config: CropConfig) -> bool:
    """Tell whether an instance is of a size that can be factored out."""
    shape = room.instances[index].shape
    return bool(
        config.least_size <= shape.size <= config.most_size
        and shape.extent.min() >= config.least_extent
    )


def cut(
    triangles: RoomTriangles, index: int, rng: np.random.Generator, config: CropConfig
) -> tuple[LabelledCloud, Condition] | None:
    """Return the labelled cloud around an instance and its mesh's samples.

    None where too few of the points are the object's.
    """
    own = triangles.corners[triangles.owner == index]
    low, high = expanded_box(own, rng, config)
    lowest, highest = triangles.bounds
    near = ((highest >= low) & (lowest <= high)).all(axis=1)
    corners, owner = triangles.corners[near], triangles.owner[near]
    points, which = _fill_box(corners, low, high, rng, config.pool)
    cloud = LabelledCloud(points, owner[which] == index)
    cloud = cloud.subset(~_pressed(points, owner[which], triangles, low, high))
    if cloud.label.mean() < config.least_positive:
        return None
    chosen, on = sample_triangles(own, config.samples, rng)
    return cloud, Condition(chosen, on, own)


def expanded_box(
    own: Float[np.ndarray, "t 3 3"], rng: np.random.Generator, config: CropConfig
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """Return an instance's box, grown at random on every side (y is down)."""
    low, high = own.min(axis=(0, 1)), own.max(axis=(0, 1))
    size = float((high - low).max())
    side = rng.uniform(*config.sideways, 4) * size
    low = low - np.array([side[0], rng.uniform(*config.above) * size, side[1]])
    high = high + np.array([side[2], rng.uniform(*config.below) * size, side[3]])
    return low, high


def _fill_box(
    corners: Float[np.ndarray, "t 3 3"],
    low: Float[np.ndarray, "3"],
    high: Float[np.ndarray, "3"],
    rng: np.random.Generator,
    count: int,
) -> tuple[Float[np.ndarray, "n 3"], Int[np.ndarray, " n"]]:
    """Draw ``count`` points of the triangles that lie in the box."""
    points, which, found = [], [], 0
    while found < count:
        drawn, on = sample_triangles(corners, count, rng)
        inside = ((drawn >= low) & (drawn <= high)).all(axis=1)
        points.append(drawn[inside])
        which.append(on[inside])
        found += int(inside.sum())
    return np.concatenate(points)[:count], np.concatenate(which)[:count]


def _pressed(
    points: Float[np.ndarray, "n 3"],
    owner: Int[np.ndarray, " n"],
    triangles: RoomTriangles,
    low: Float[np.ndarray, "3"],
    high: Float[np.ndarray, "3"],
) -> Bool[np.ndarray, " n"]:
    """Tell which points lie where an instance's flat base presses on what carries it."""
    pressed = np.zeros(len(points), bool)
    for index in np.unique(triangles.owner[triangles.owner >= 0]):
        instance = triangles.room.instances[index]
        base_y = instance.position[1]
        at_base = np.flatnonzero(np.abs(points[:, 1] - base_y) < PRESSED)
        if not len(at_base) or not low[1] - PRESSED <= base_y <= high[1] + PRESSED:
            continue
        carrier = (owner[at_base] == instance.rests_on) | (owner[at_base] == -1)
        at_base = at_base[carrier | (owner[at_base] == index)]
        own = triangles.corners[triangles.owner == index]
        flat = own[(np.abs(own[:, :, 1] - base_y) < PRESSED).all(axis=1)]
        if len(flat) and len(at_base):
            pressed[at_base] |= _in_triangles(points[at_base][:, [0, 2]], flat[:, :, [0, 2]])
    return pressed


def _in_triangles(
    points: Float[np.ndarray, "n 2"], triangles: Float[np.ndarray, "t 3 2"]
) -> Bool[np.ndarray, " n"]:
    """Tell which points lie in any of some triangles of the plane, borders included."""
    side = []
    for k in range(3):
        a, b = triangles[:, k], triangles[:, (k + 1) % 3]
        edge, to = b - a, points[:, None] - a
        side.append(edge[:, 0] * to[..., 1] - edge[:, 1] * to[..., 0])
    signs = np.stack(side)
    inside = np.logical_or((signs >= -1e-12).all(axis=0), (signs <= 1e-12).all(axis=0))
    return np.asarray(np.any(inside, axis=1))
