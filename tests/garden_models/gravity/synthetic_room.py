"""Make rooms of rectangles with photos, points and exact gravity, in a randomly turned world."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np

from garden_models.geometry.camera import camera_centre, inside_image, project
from garden_models.geometry.rigid import invert_rigid, rigid, transform_points
from garden_models.geometry.rotation import axis_angle, matrix_from_quaternion
from garden_models.scene import PointCloud, Reconstruction, Scale, View

SIZE = (400, 300)
K = np.array([[340.0, 0, 200], [0, 340.0, 150], [0, 0, 1]])


@dataclass(frozen=True)
class Room:
    """What the room holds and how it is photographed (metres, degrees; z is up here)."""

    seed: int = 0
    floor: bool = True
    table: bool = True
    walls: int = 2
    boxes: int = 3
    slanted: int = 0
    corridor: bool = False
    ceiling: bool = False
    photos: int = 10
    pitch_deg: float = 25.0
    orbit_deg: float = 140.0
    roll_deg: float = 0.0
    portrait_share: float = 0.0
    crooked_deg: float = 0.0
    roll_spread_deg: float = 2.0
    noise: float = 0.004
    outliers: float = 0.05
    points: int = 12000


def rectangle(corner: tuple, u: tuple, v: tuple) -> np.ndarray:
    """Return the four corners of a parallelogram."""
    c, a, b = (np.array(x, dtype=float) for x in (corner, u, v))
    return np.stack([c, c + a, c + a + b, c + b])


def box(centre: np.ndarray, size: np.ndarray, yaw: float) -> list[np.ndarray]:
    """Return top and sides of an upright box that stands at ``centre``."""
    turn = axis_angle(np.array([0, 0, 1.0]), yaw)
    x, y = turn[:, 0] * size[0], turn[:, 1] * size[1]
    z = np.array([0, 0, size[2]])
    low = centre - (x + y) / 2
    sides = [(low, x), (low + x, y), (low + x + y, -x), (low + y, -y)]
    return [rectangle(low + z, x, y)] + [rectangle(start, along, z) for start, along in sides]


def rectangles(room: Room, rng: np.random.Generator) -> list[np.ndarray]:
    """Return everything in the room; each surface leans a little if the room is crooked."""
    return [
        part.mean(0) + (part - part.mean(0)) @ lean.T
        for part in straight_rectangles(room, rng)
        for lean in [axis_angle(rng.normal(size=3), np.radians(room.crooked_deg) * rng.normal())]
    ]


def straight_rectangles(room: Room, rng: np.random.Generator) -> list[np.ndarray]:
    parts: list[np.ndarray] = []
    if room.corridor:
        for side in (-1.0, 1.0):
            parts.append(rectangle((-1, side, 0), (9, 0, 0), (0, 0, 2.4)))
            parts += [
                rectangle((x, 0.99 * side, 0), (0.9, 0, 0), (0, 0, 2.0)) for x in (0.5, 2, 4, 6)
            ]
    if room.floor:
        parts.append(rectangle((-2.5, -2.5, 0), (5, 0, 0), (0, 5, 0)))
    if room.ceiling:
        parts.append(rectangle((-2.5, -2.5, 2.6), (5, 0, 0), (0, 5, 0)))
    walls = [
        rectangle((-2.5, 2.0, 0), (5, 0, 0), (0, 0, 2.6)),
        rectangle((-2.0, -2.5, 0), (0, 5, 0), (0, 0, 2.6)),
    ]
    # A door and two pictures give the walls edges to be seen.
    hung = [
        [
            rectangle((-0.6, 1.99, 0.02), (0.9, 0, 0), (0, 0, 2.0)),
            rectangle((0.8, 1.99, 1.2), (0.7, 0, 0), (0, 0, 0.5)),
        ],
        [rectangle((-1.99, -0.5, 1.0), (0, 0.8, 0), (0, 0, 0.9))],
    ]
    for wall, pictures in list(zip(walls, hung, strict=True))[: room.walls]:
        parts += [wall, *pictures]
    height = 0.0
    if room.table:
        height = 0.75
        parts += box(np.zeros(3), np.array([1.4, 0.8, height]), 0.3)
    for _ in range(room.boxes):
        where = np.array([*rng.uniform(-0.3, 0.3, 2), height])
        parts += box(where, rng.uniform(0.1, 0.35, 3), rng.uniform(0, np.pi))
    for _ in range(room.slanted):
        tilt = axis_angle(rng.normal(size=3), rng.uniform(0.15, 1.0))
        flat = rectangle((-0.3, -0.25, 0), (0.6, 0, 0), (0, 0.5, 0)) @ tilt.T
        parts.append(flat + np.array([*rng.uniform(-0.6, 0.6, 2), height + 0.25]))
    return parts


def cameras(room: Room, rng: np.random.Generator) -> list[np.ndarray]:
    """Return ``camera_from_room`` of photos on an arc that look at the middle of the room,
    or that walk along the corridor.
    """
    out = []
    start = -np.pi / 4 - np.radians(room.orbit_deg) / 2
    for i in range(room.photos):
        azimuth = start + np.radians(room.orbit_deg) * i / max(1, room.photos - 1)
        pitch = np.radians(room.pitch_deg + rng.normal(0, 4))
        radius = rng.uniform(1.5, 1.9)
        if room.corridor:
            azimuth = np.pi + rng.normal(0, 0.02)
        away = np.array([np.cos(azimuth), np.sin(azimuth), 0])
        forward = -away * np.cos(pitch) - np.array([0, 0, np.sin(pitch)])
        x = np.cross(forward, [0, 0, 1.0])
        x /= np.linalg.norm(x)
        level = np.stack([x, np.cross(forward, x), forward])
        turn = 90.0 if i < room.portrait_share * room.photos else 0.0
        roll = np.radians(room.roll_deg + turn + rng.normal(0, room.roll_spread_deg))
        rotation = axis_angle(np.array([0, 0, 1.0]), roll) @ level
        centre = np.array([0, 0, 0.85]) - forward * radius
        if room.corridor:
            centre = np.array([0.15 * i - 0.9, rng.normal(0, 0.05), 1.5])
        out.append(rigid(rotation, -rotation @ centre))
    return out


def clip_front(corners: np.ndarray, near: float = 0.05) -> np.ndarray:
    """Cut a polygon in camera coordinates at ``z = near`` (Sutherland and Hodgman)."""
    kept = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if a[2] >= near:
            kept.append(a)
        if (a[2] >= near) != (b[2] >= near):
            kept.append(a + (b - a) * (near - a[2]) / (b[2] - a[2]))
    return np.array(kept)


def photograph(parts: list[np.ndarray], greys: np.ndarray, camera: np.ndarray, rng) -> np.ndarray:
    """Paint the rectangles far to near, each in its grey, with a little noise."""
    picture = np.full((SIZE[1], SIZE[0]), 30, np.uint8)
    in_camera = [transform_points(camera, part) for part in parts]
    size = [float(np.abs(p - p.mean(0)).max()) for p in parts]
    # Large surfaces are the background of small ones whatever their mean depth.
    order = sorted(
        range(len(parts)), key=lambda i: (size[i] < 1.2, -np.linalg.norm(in_camera[i].mean(0)))
    )
    for i in order:
        polygon = clip_front(in_camera[i])
        if len(polygon) >= 3:
            pixels = polygon[:, :2] / polygon[:, 2:] * K[0, 0] + K[:2, 2] - 0.5
            fixed = np.round(np.clip(pixels, -4000, 4000) * 256).astype(np.int32)
            cv2.fillPoly(picture, [fixed], int(greys[i]), cv2.LINE_AA, shift=8)
    noisy = picture + rng.normal(0, 1.5, picture.shape)
    return np.repeat(np.clip(noisy, 0, 255).astype(np.uint8)[..., None], 3, axis=2)


def fused_points(
    parts: list[np.ndarray], views_room: list[np.ndarray], room: Room, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return noisy points on what two photos or more see, and normals that face them."""
    area = np.array([np.linalg.norm(np.cross(p[1] - p[0], p[3] - p[0])) for p in parts])
    which = rng.choice(len(parts), size=4 * room.points, p=area / area.sum())
    corners = np.array(parts)[which]
    s, t = rng.uniform(size=(2, len(which), 1))
    along, across = corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0]
    points = corners[:, 0] + s * along + t * across
    normals = np.cross(along, across)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    seen = np.zeros(len(points), dtype=int)
    facing = np.zeros(len(points))
    nearest = np.full(len(points), np.inf)
    for camera in views_room:
        pixels, z = project(points, K, camera)
        inside = inside_image(pixels, SIZE) & (z > 0.2)
        seen += inside
        towards = camera_centre(camera) - points
        facing += inside * np.sign(np.einsum("ni,ni->n", normals, towards))
        nearest = np.where(inside, np.minimum(nearest, z), nearest)
    keep = np.flatnonzero((seen >= 2) & (facing != 0))[: room.points]
    points, normals, nearest = points[keep], normals[keep], nearest[keep]
    normals *= np.sign(facing[keep])[:, None]
    points = points + normals * (rng.normal(0, room.noise, len(keep)) * nearest)[:, None]
    normals = normals + rng.normal(0, 0.15, normals.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    wild = rng.uniform(size=len(points)) < room.outliers
    points[wild] += rng.normal(0, 0.3, (wild.sum(), 3))
    return points, normals


def views_in_world(
    views_room: list[np.ndarray], pictures: list[np.ndarray], room_from_world: np.ndarray
) -> tuple[View, ...]:
    """Return views without depth in the turned world."""
    empty = np.zeros((SIZE[1], SIZE[0]))
    return tuple(
        View(f"{i:03d}.jpg", picture, empty, empty, K, (camera @ room_from_world)[:3], SIZE)
        for i, (camera, picture) in enumerate(zip(views_room, pictures, strict=True))
    )


def turned_world(rng: np.random.Generator) -> np.ndarray:
    """Return a random ``world_from_room``."""
    return rigid(matrix_from_quaternion(rng.normal(size=4)), rng.normal(size=3))


def reconstruct(views: tuple[View, ...], xyz: np.ndarray, normal: np.ndarray) -> Reconstruction:
    count = len(xyz)
    grey = np.full((count, 3), 128, np.uint8)
    cloud = PointCloud(xyz, grey, normal, np.full(count, 0.02), np.ones(count))
    return Reconstruction(views, cloud, xyz[:100], (), Scale("unknown"))


@cache
def make_room(room: Room) -> tuple[Reconstruction, np.ndarray]:
    """Return a reconstruction of the room in a turned world, and the true down there."""
    rng = np.random.default_rng(room.seed)
    parts = rectangles(room, rng)
    views_room = cameras(room, rng)
    points, normals = fused_points(parts, views_room, room, rng)
    world_from_room = turned_world(rng)
    greys = rng.permutation(np.linspace(60, 240, len(parts)))
    pictures = [photograph(parts, greys, camera, rng) for camera in views_room]
    views = views_in_world(views_room, pictures, invert_rigid(world_from_room))
    xyz = transform_points(world_from_room, points)
    reconstruction = reconstruct(views, xyz, normals @ world_from_room[:3, :3].T)
    return reconstruction, -world_from_room[:3, 2]


def cameras_only(room: Room) -> tuple[Reconstruction, np.ndarray]:
    """Return cameras of the room with blank photos and no points, and the true down."""
    rng = np.random.default_rng(room.seed)
    views_room = cameras(room, rng)
    world_from_room = turned_world(rng)
    blank = [np.full((SIZE[1], SIZE[0], 3), 90, np.uint8)] * len(views_room)
    views = views_in_world(views_room, blank, invert_rigid(world_from_room))
    nothing = np.zeros((0, 3))
    return reconstruct(views, nothing, nothing), -world_from_room[:3, 2]
