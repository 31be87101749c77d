"""Furnish rooms: furniture along walls, tables with chairs, things on every surface.

Things stand alone, near each other or in contact; many rooms hold the same shape several
times. Same seed, same room.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from garden_models.disentanglement.training.scenes.room import Instance, Room, overlap
from garden_models.disentanglement.training.scenes.structure import room_structure
from garden_models.disentanglement.training.shapes.families import FURNITURE, SMALL, make_shape
from garden_models.disentanglement.training.shapes.shape import Shape, Shelf
from garden_models.disentanglement.training.splits import Split, allowed

CONTACT = (0.0007, 0.003)
NEAR = (0.003, 0.02)
APART = (0.02, 0.12)
"""Gaps between neighbours, metres: touching, nearly touching, apart."""

AT_WALLS = ("cabinet", "shelf", "desk", "sofa", "bed", "appliance", "cabinet", "shelf")
IN_THE_MIDDLE = ("table", "round_table", "table")
ON_THE_FLOOR = (
    "stool", "pouf", "floor_lamp", "coat_stand", "bin", "bench", "office_chair", "chair",
    "carton", "plant", "shoe", "ball", "vase", "cushion", "speaker", "soft_toy", "toy_car",
)  # fmt: skip
TRIES = 12
MOST_ON_A_SHELF = 14


@dataclass(frozen=True)
class Meshes:
    """Further small shapes from packages, by which a split's rooms become more varied."""

    shapes: tuple[Shape, ...] = ()
    share: float = 0.25


class _Furnisher:
    """The state of one room while it is being filled."""

    def __init__(self, split: Split, seed: int, meshes: Meshes) -> None:
        self.rng = np.random.default_rng((3, seed))
        self.members = allowed(split).members
        self.meshes = meshes
        self.width, self.depth = self.rng.uniform(2.6, 5.5, 2)
        self.placed: list[Instance] = []
        self.known: dict[str, list[Shape]] = {}

    def shape(self, family: str, again: float = 0.35) -> Shape:
        """Return a member of a family; with probability ``again`` one that was used here."""
        known = self.known.setdefault(family, [])
        if known and self.rng.random() < again:
            return known[int(self.rng.integers(len(known)))]
        known.append(make_shape(family, int(self.rng.integers(*self.members))))
        return known[-1]

    def small(self) -> Shape:
        """Return something that stands on furniture."""
        if self.meshes.shapes and self.rng.random() < self.meshes.share:
            return self.meshes.shapes[int(self.rng.integers(len(self.meshes.shapes)))]
        return self.shape(str(self.rng.choice(sorted(SMALL))))

    def add(self, propose: Callable[[], Instance | None], ignore: Sequence[int] = ()) -> int | None:
        """Place the first proposal that collides with nothing; return its index."""
        for _ in range(TRIES):
            instance = propose()
            if instance is None:
                continue
            others = (other for k, other in enumerate(self.placed) if k not in ignore)
            if self._inside(instance) and not any(overlap(instance, o, 5e-4) for o in others):
                self.placed.append(instance)
                return len(self.placed) - 1
        return None

    def _inside(self, instance: Instance) -> bool:
        low, high = instance.box
        inside = low[0] > 0 and low[2] > 0 and high[0] < self.width and high[2] < self.depth
        return bool(inside)

    def at_wall(self, family: str) -> int | None:
        """Place furniture with its back to one of two walls."""
        shape = self.shape(family)
        on_x = self.rng.random() < 0.5
        yaw = (90.0 if on_x else 180.0) + self.rng.choice([0.0, self.rng.normal(0, 3)])
        free = self.rng.choice([self.rng.uniform(0.002, 0.02), self.rng.uniform(0.02, 0.12)])

        def propose() -> Instance:
            along = self.rng.uniform(0, self.depth if on_x else self.width)
            at = Instance(shape, (0.0, 0.0, 0.0), yaw)
            x, z = (free - at.box[0, 0], along) if on_x else (along, free - at.box[0, 2])
            return Instance(shape, (float(x), 0.0, float(z)), yaw)

        return self.add(propose)

    def on_floor(self, family: str) -> int | None:
        """Place something anywhere on the floor, or next to something that is there."""
        shape = self.shape(family)

        def propose() -> Instance:
            yaw = self.rng.uniform(0, 360)
            standing = [k for k, other in enumerate(self.placed) if other.rests_on < 0]
            if standing and self.rng.random() < 0.5:
                return self.beside(shape, yaw, self.placed[int(self.rng.choice(standing))])
            x, z = self.rng.uniform(0, 1, 2) * (self.width, self.depth)
            return Instance(shape, (float(x), 0.0, float(z)), yaw)

        return self.add(propose)

    def beside(self, shape: Shape, yaw: float, other: Instance) -> Instance:
        """Return an instance that keeps a small gap from another, on the same level."""
        free = self.rng.uniform(*(CONTACT, NEAR, APART)[int(self.rng.integers(3))])
        angle = self.rng.uniform(0, 2 * np.pi)
        u = np.array([np.cos(angle), np.sin(angle)])
        level = other.position[1]
        alone = Instance(shape, (0.0, 0.0, 0.0), yaw)
        reach = (other.vertices[:, [0, 2]] @ u).max() - (alone.vertices[:, [0, 2]] @ u).min() + free
        centre = np.array([other.position[0], other.position[2]])
        across = np.array([-u[1], u[0]])
        slide = self.rng.normal(0, 0.25) * other.shape.extent[[0, 2]].min()
        at = u * reach + across * (centre @ across + slide)
        return Instance(shape, (float(at[0]), level, float(at[1])), yaw, other.rests_on)

    def table_group(self) -> None:
        """Place a table in the middle, with chairs of one shape around it."""
        at = self.on_floor(str(self.rng.choice(IN_THE_MIDDLE)))
        if at is None:
            return
        table, seat = self.placed[at], self.shape("chair", again=0.6)
        for side in range(int(self.rng.integers(0, 7))):
            self.add(partial(self._chair, table, seat, side), ignore=(at,))

    def _chair(self, table: Instance, seat: Shape, side: int) -> Instance:
        """Return a chair that faces one side of a table, pushed in or drawn out."""
        wide, deep = table.shape.extent[0] / 2, table.shape.extent[2] / 2
        facing = side % 4
        out = (deep, wide, deep, wide)[facing] + self.rng.uniform(-0.15, 0.25)
        across = self.rng.uniform(-0.6, 0.6) * (wide, deep, wide, deep)[facing]
        turn = np.radians(table.yaw_deg + 90 * facing)
        x = table.position[0] + out * np.sin(turn) + across * np.cos(turn)
        z = table.position[2] + out * np.cos(turn) - across * np.sin(turn)
        yaw = np.degrees(turn) + self.rng.normal(0, 8)
        return Instance(seat, (float(x), 0.0, float(z)), float(yaw))

    def load(self, carrier: int) -> None:
        """Put things on every shelf of an instance."""
        for shelf in self.placed[carrier].shape.shelves:
            if shelf.clearance < 0.05 or self.rng.random() < 0.2:
                continue
            area = (shelf.x[1] - shelf.x[0]) * (shelf.z[1] - shelf.z[0])
            count = min(int(self.rng.poisson(2 + 16 * area)), MOST_ON_A_SHELF)
            on_it: list[int] = []
            repeated = self.small() if self.rng.random() < 0.5 else None
            for _ in range(count):
                shape = repeated if repeated and self.rng.random() < 0.6 else self.small()
                self._on_shelf(carrier, shelf, shape, on_it)

    def _on_shelf(self, carrier: int, shelf: Shelf, shape: Shape, on_it: list[int]) -> None:
        if shape.extent[1] > 0.97 * shelf.clearance:
            return
        base = self.placed[carrier]

        def propose() -> Instance | None:
            yaw = float(self.rng.choice([base.yaw_deg, self.rng.uniform(0, 360)]))
            if on_it and self.rng.random() < 0.55:
                instance = self.beside(shape, yaw, self.placed[int(self.rng.choice(on_it))])
            else:
                x, z = self.rng.uniform([shelf.x[0], shelf.z[0]], [shelf.x[1], shelf.z[1]])
                at = _in_room(base, x, z)
                level = base.position[1] - shelf.height
                instance = Instance(shape, (at[0], level, at[1]), yaw)
            fits = _within(base, shelf, instance)
            return Instance(shape, instance.position, yaw, carrier) if fits else None

        index = self.add(propose, ignore=(carrier,))
        if index is not None:
            on_it.append(index)


def furnish(split: Split, number: int, meshes: Meshes = Meshes()) -> Room:
    """Return the split's furnished room of that number, with 20 to 150 instances."""
    seed = allowed(split).scene(number)
    room = _Furnisher(split, seed, meshes)
    rng = room.rng
    for _ in range(int(rng.integers(2, 6))):
        room.at_wall(str(rng.choice(AT_WALLS)))
    for _ in range(int(rng.integers(1, 3))):
        room.table_group()
    for _ in range(int(rng.integers(5, 14))):
        room.on_floor(str(rng.choice(ON_THE_FLOOR)))
    first = 0
    for _ in range(2):  # what stands on furniture may carry something itself
        last = len(room.placed)
        for carrier in range(first, last):
            room.load(carrier)
        first = last
    structure = room_structure(rng, room.width, room.depth, float(rng.uniform(2.3, 2.8)))
    return Room(f"{split}/{number}", tuple(room.placed), structure)


def _in_room(base: Instance, x: float, z: float) -> tuple[float, float]:
    """Return a place of an instance's own frame in the room (x, z)."""
    c, s = np.cos(np.radians(base.yaw_deg)), np.sin(np.radians(base.yaw_deg))
    return float(c * x + s * z + base.position[0]), float(-s * x + c * z + base.position[2])


def _within(base: Instance, shelf: Shelf, instance: Instance) -> bool:
    """Tell whether an instance's base stands on a shelf, its middle well inside."""
    c, s = np.cos(np.radians(base.yaw_deg)), np.sin(np.radians(base.yaw_deg))
    low = instance.vertices[:, 1] > instance.position[1] - 0.02
    x, z = (instance.vertices[low][:, [0, 2]] - (base.position[0], base.position[2])).T
    u, v = c * x - s * z, s * x + c * z
    return bool(
        (u > shelf.x[0]).all() and (u < shelf.x[1]).all()
        and (v > shelf.z[0]).all() and (v < shelf.z[1]).all()
    )  # fmt: skip


FAMILIES_IN_ROOMS = tuple(sorted({*AT_WALLS, *IN_THE_MIDDLE, *ON_THE_FLOOR, *FURNITURE, *SMALL}))
