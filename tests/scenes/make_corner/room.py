"""Lay out the room: walls, floor, rug, table, bookcase, pictures and the three objects.

The room frame is z up, metres, with the corner at the origin and walls in x = 0 and
y = 0. Everything but the objects is made of textured quads.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from . import paint, shapes, textures
from .duck import duck
from .noise import Array
from .shapes import Shape

ROOM = (4.0, 4.0, 2.6)
TABLE_LOW = (0.60, 0.72)
TABLE_SIZE = (1.10, 0.75)
TABLE_HEIGHT = 0.75
# Object frame (y down) from the frame in which the shapes are made (z up).
OBJECT_FROM_MADE = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])


@dataclass(frozen=True)
class Quad:
    """A textured parallelogram ``origin + s * right + t * up``, s and t in 0..1.

    ``texture`` names an entry of ``pictures``; it is seen from both sides.
    """

    name: str
    origin: Array
    right: Array
    up: Array
    texture: str


@dataclass(frozen=True)
class Placed:
    """An object in the room: its shape, its paint and where it stands.

    ``origin`` is the point of the shape's frame that becomes the object's origin: the
    centre of the box around its base; it comes to lie at ``position``.
    """

    name: str
    shape: Shape
    paint: Callable[[Array, Array], Array]
    yaw_deg: float
    position: Array
    yaw_symmetric: bool

    @property
    def origin(self) -> Array:
        """Centre of the box around the base, in the shape's frame, ``(3,)``."""
        base = self.shape.vertices[self.shape.vertices[:, 2] < 1e-9]
        return np.asarray((base.min(axis=0) + base.max(axis=0)) / 2)

    @property
    def room_from_made(self) -> Array:
        """Rigid 4x4 transform from the frame of the shape to the room."""
        c, s = np.cos(np.radians(self.yaw_deg)), np.sin(np.radians(self.yaw_deg))
        matrix = np.eye(4)
        matrix[:3, :3] = [[c, -s, 0], [s, c, 0], [0, 0, 1]]
        matrix[:3, 3] = self.position - matrix[:3, :3] @ self.origin
        return matrix

    @property
    def object_from_made(self) -> Array:
        """Rigid 4x4 transform from the frame of the shape to the upright object frame."""
        matrix = np.eye(4)
        matrix[:3, :3] = OBJECT_FROM_MADE
        matrix[:3, 3] = -OBJECT_FROM_MADE @ self.origin
        return matrix


def box(
    name: str, low: Array, size: Array, side: str, top: str, front: str | None = None
) -> list[Quad]:
    """Return the quads of an axis-aligned box; ``front`` covers its +y side."""
    (x, y, z), (a, b, c) = low, size
    ex, ey, ez = np.diag(size)
    return [
        Quad(f"{name}_top", np.array([x, y, z + c]), ex, ey, top),
        Quad(f"{name}_bottom", np.array([x, y, z]), ey, ex, side),
        Quad(f"{name}_front", np.array([x + a, y + b, z]), -ex, ez, front or side),
        Quad(f"{name}_back", np.array([x, y, z]), ex, ez, side),
        Quad(f"{name}_right", np.array([x + a, y, z]), ey, ez, side),
        Quad(f"{name}_left", np.array([x, y + b, z]), -ey, ez, side),
    ]


def quads() -> list[Quad]:
    """Return every textured surface of the room and its furniture."""
    a, b, h = ROOM
    ex, ey, ez = np.eye(3)
    found = [
        Quad("floor", np.zeros(3), a * ex, b * ey, "floor"),
        Quad("ceiling", np.array([0, 0, h]), b * ey, a * ex, "plaster"),
        Quad("wall_x0", np.array([0, b, 0]), -b * ey, h * ez, "wall_a"),
        Quad("wall_y0", np.zeros(3), a * ex, h * ez, "wall_b"),
        Quad("wall_x1", np.array([a, 0, 0]), b * ey, h * ez, "wall_b"),
        Quad("wall_y1", np.array([a, b, 0]), -a * ex, h * ez, "wall_a"),
    ]
    found += box("rug", np.array([0.35, 0.45, 0.0]), np.array([2.2, 1.6, 0.008]), "legs", "rug")
    found += box(
        "bookcase",
        np.array([0.12, 0.0, 0.0]),
        np.array([1.0, 0.26, 0.9]),
        "legs",
        "shelf_top",
        "books",
    )
    (x, y), (lx, ly) = TABLE_LOW, TABLE_SIZE
    thick = 0.032
    top_low = np.array([x, y, TABLE_HEIGHT - thick])
    found += box("table_top", top_low, np.array([lx, ly, thick]), "apron", "table_top")
    leg, inset, drop = 0.055, 0.04, 0.008
    for i, (u, v) in enumerate(((0, 0), (1, 0), (1, 1), (0, 1))):
        at = np.array(
            [x + inset + u * (lx - 2 * inset - leg), y + inset + v * (ly - 2 * inset - leg), drop]
        )
        found += box(f"leg{i}", at, np.array([leg, leg, top_low[2] - drop]), "legs", "legs")
    apron_low = np.array([x + inset, y + inset, top_low[2] - 0.09])
    found += box(
        "apron", apron_low, np.array([lx - 2 * inset, ly - 2 * inset, 0.09]), "apron", "apron"
    )
    for i, (low, size) in enumerate(
        (
            ((0.0, 0.45, 0.95), (0.02, 0.90, 0.66)),
            ((0.0, 1.65, 0.60), (0.02, 0.66, 0.86)),
            ((0.0, 2.55, 0.85), (0.02, 0.80, 0.60)),
        )
    ):
        found += box(f"picture{i}", np.array(low), np.array(size), "legs", "legs")
        side = next(q for q in found if q.name == f"picture{i}_right")
        found[found.index(side)] = Quad(side.name, side.origin, side.right, side.up, f"poster{i}")
    for i, (low, size) in enumerate(
        (((1.35, 0.0, 0.62), (0.70, 0.02, 0.86)), ((2.25, 0.0, 0.90), (0.90, 0.02, 0.60)))
    ):
        found += box(
            f"picture{i + 3}", np.array(low), np.array(size), "legs", "legs", f"poster{i + 3}"
        )
    return found


def pictures(pitch_scale: float = 1.0) -> dict[str, Array]:
    """Return every texture by name, sRGB 0..1 ``(h, w, 3)``; coarser if scaled up."""
    a, b, h = ROOM

    def bake(picture: textures.Picture, width: float, height: float, mm: float, seed: int) -> Array:
        return textures.bake(picture, width, height, mm * 1e-3 * pitch_scale, seed)

    def legs(points: Array) -> Array:
        return textures.boards(points[:, [1, 0, 2]], 0.06, 1.0, ("4a2f1a", "7b5430", "a3774a"), 700)

    def plaster(points: Array) -> Array:
        return 0.72 + 0.16 * textures.fbm(points * 6.0, 4, 720)[:, None] * np.ones(3)

    sizes = ((0.90, 0.66), (0.66, 0.86), (0.80, 0.60), (0.70, 0.86), (0.90, 0.60))
    found = {
        "floor": bake(textures.floor, a, b, 2.4, 1),
        "wall_a": bake(textures.wallpaper, b, h, 3.0, 2),
        "wall_b": bake(textures.wallpaper, a, h, 3.0, 3),
        "plaster": bake(plaster, a, b, 20.0, 4),
        "rug": bake(textures.rug, 2.2, 1.6, 1.8, 5),
        "table_top": bake(textures.table_top, *TABLE_SIZE, 0.8, 6),
        "apron": bake(
            lambda p: textures.boards(p, 0.1, 1.0, ("6a4526", "9d6f3f", "c09058"), 710),
            1.0,
            0.1,
            0.8,
            7,
        ),
        "legs": bake(legs, 0.06, 0.7, 0.8, 8),
        "shelf_top": bake(legs, 1.0, 0.26, 1.5, 9),
        "books": bake(textures.books, 1.0, 0.9, 1.6, 10),
    }
    for i, size in enumerate(sizes):
        found[f"poster{i}"] = bake(textures.poster(800 + 40 * i), *size, 1.8, 11 + i)
    return found


def objects() -> list[Placed]:
    """Return the three objects; the duck's side touches the gable wall of the house."""
    middle = np.array(TABLE_LOW) + 0.5 * np.array(TABLE_SIZE)
    centre = np.append(middle, TABLE_HEIGHT)
    home_at = centre + np.array([0.02, 0.03, 0.0])
    home = Placed("house", shapes.house(), paint.house, 123.0, home_at, False)
    jar_at = centre + np.array([-0.27, 0.07, 0.0])
    pot = Placed("jar", shapes.jar(), paint.jar, 0.0, jar_at, True)
    bird = Placed("duck", duck(), paint.duck, home.yaw_deg - 84.0, centre, False)
    return [home, against_gable(bird, home, along=-0.006), pot]


def against_gable(item: Placed, home: Placed, along: float) -> Placed:
    """Push ``item`` against the -x wall of ``home`` until they just touch.

    ``along`` is the item's y in the frame of the house, metres. The wall is a plane, so
    contact is where the item's furthest vertex meets it; no search is needed.
    """
    low = home.shape.vertices[home.shape.vertices[:, 2] < 1e-9, 0]
    turn = np.radians(item.yaw_deg - home.yaw_deg)
    sideways = (item.shape.vertices - item.origin)[:, :2] @ [np.cos(turn), -np.sin(turn)]
    place = np.array([low.min() - sideways.max(), along, 0.0, 1.0])
    return replace(item, position=(home.room_from_made @ place)[:3])
