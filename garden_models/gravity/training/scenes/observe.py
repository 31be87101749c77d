"""Make the evidence of a procedural capture, in a randomly turned world, with exact gravity."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from garden_models.geometry.depth_normals import depth_normals
from garden_models.geometry.rigid import invert_rigid, rigid
from garden_models.geometry.rotation import axis_angle, matrix_from_quaternion
from garden_models.gravity.decoder.evidence import GRID, ViewEvidence, gather
from garden_models.gravity.training.scenes.edges import all_edges, seen_segments
from garden_models.gravity.training.scenes.furnish import Room, RoomKind, furnish
from garden_models.gravity.training.scenes.photographer import PhotographerKind, random_cameras
from garden_models.gravity.training.scenes.sensing import (
    PHOTO_WIDTH,
    SIZE,
    Errors,
    Look,
    blank_faces,
    look,
    measured_depth,
    measured_segments,
    random_errors,
)
from garden_models.gravity.training.splits import Split, scene_generator
from garden_models.gravity.vanishing_points import Segments, lift

MAX_TRIES = 20
LEAST_SEEN = 0.3
"""Share of a photo that must show something, or other cameras are tried."""


@dataclass(frozen=True)
class Photographed:
    """A room with cameras (from the room, and with the measured error from the world)."""

    room: Room
    K: Float[np.ndarray, "3 3"]
    camera_from_room: Float[np.ndarray, "v 4 4"]
    camera_from_world: Float[np.ndarray, "v 4 4"]
    down_world: Float[np.ndarray, "3"]
    errors: Errors


def photographed(
    rng: np.random.Generator,
    room_kind: RoomKind = RoomKind(),
    photographer: PhotographerKind = PhotographerKind(),
    size: tuple[int, int] = SIZE,
    turned: float | None = None,
) -> Photographed:
    """Return a random room with cameras that see something of it.

    ``turned`` is the error of their rotations in radians; None leaves it to chance.
    """
    room = furnish(rng, room_kind)
    focal = size[0] / (2 * np.tan(np.radians(rng.uniform(45, 78)) / 2))
    K = np.array([[focal, 0, size[0] / 2], [0, focal, size[1] / 2], [0, 0, 1]])
    cameras = random_cameras(room, rng, photographer)
    coarse = np.diag([16 / size[0], 12 / size[1], 1]) @ K
    for _ in range(MAX_TRIES):
        if min((look(room.surfaces, coarse, c, (16, 12)).face >= 0).mean() for c in cameras) > (
            LEAST_SEEN
        ):
            break
        cameras = random_cameras(room, rng, photographer)
    errors = random_errors(rng)
    if turned is not None:
        errors = dataclasses.replace(errors, turned=turned)
    world_from_room = rigid(matrix_from_quaternion(rng.normal(size=4)), rng.normal(size=3))
    room_from_world = invert_rigid(world_from_room)
    measured = np.stack([_turned(camera, errors.turned, rng) for camera in cameras])
    return Photographed(
        room, K, cameras, measured @ room_from_world, -world_from_room[:3, 2], errors
    )


def observe(shot: Photographed, rng: np.random.Generator) -> ViewEvidence:
    """Return the evidence of a photographed room with its errors; a random reference view."""
    surfaces = shot.room.surfaces
    blank = blank_faces(surfaces, shot.errors, rng)
    edges = all_edges(surfaces, rng)
    planes, lines = [], []
    for k, (true, camera) in enumerate(
        zip(shot.camera_from_room, shot.camera_from_world, strict=True)
    ):
        seen: Look = look(surfaces, shot.K, true)
        depth = measured_depth(seen, blank, shot.errors, rng)
        planes.append(depth_normals(depth, shot.K, camera, GRID))
        found = seen_segments(edges, seen.depth, shot.K, true)
        found = measured_segments(found, SIZE, shot.errors, rng)
        # Errors of segments are those of pixels of a photo, not of the coarse depth map.
        factor = PHOTO_WIDTH / SIZE[0]
        photo_K = np.diag([factor, factor, 1]) @ shot.K
        photo_size = (round(SIZE[0] * factor), round(SIZE[1] * factor))
        lifted = lift(found * factor, photo_K, camera[:3, :3], photo_size)
        lines.append(Segments(*lifted, np.full(len(found), k)))
    segments = Segments(
        *(
            np.concatenate([getattr(part, name) for part in lines])
            for name in ("normals_world", "sigma_rad", "weight", "view")
        )
    )
    reference = int(rng.integers(len(shot.camera_from_world)))
    return gather(shot.camera_from_world, planes, segments, reference)


def training_scene(split: Split, number: int) -> tuple[ViewEvidence, Float[np.ndarray, "3"]]:
    """Return the evidence of a split's scene and its true direction down."""
    rng = scene_generator(split, number)
    shot = photographed(rng)
    return observe(shot, rng), shot.down_world


def _turned(
    camera: Float[np.ndarray, "4 4"], sigma: float, rng: np.random.Generator
) -> Float[np.ndarray, "4 4"]:
    turn = axis_angle(rng.normal(size=3), sigma * rng.normal())
    return rigid(turn, np.zeros(3)) @ camera
