"""Look at a procedural scene as our stereo and segment detector would: with their errors."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, Int

from garden_models.geometry.camera import pixel_grid, pixel_rays
from garden_models.geometry.rigid import invert_rigid
from garden_models.gravity.training.scenes.surfaces import FACES, Surfaces, cast
from garden_models.gravity.vanishing_points import ENDPOINT_PX, MIN_LENGTH

SIZE = (64, 48)
"""Width and height of the depth maps of training scenes, pixels."""
PHOTO_WIDTH = 500.0
"""Width of the photos in which segments are found, as far as their error goes."""


@dataclass(frozen=True)
class Errors:
    """How badly a capture is measured."""

    rough: float
    """Relative depth error that is smooth over a surface."""
    fine: float
    """Relative depth error of each cell alone."""
    blank: float
    """Share of faces without texture: no depth there."""
    lost: float
    """Share of cells without depth elsewhere."""
    missed: float
    """Share of edges that are not found as segments."""
    strays: int
    """Segments a view that belong to nothing built."""
    turned: float
    """Error of each camera's rotation, radians."""


def random_errors(rng: np.random.Generator) -> Errors:
    """Return errors from those of known cameras on good photos to those of poor ones."""
    return Errors(
        rough=float(np.exp(rng.uniform(np.log(0.001), np.log(0.02)))),
        fine=float(np.exp(rng.uniform(np.log(0.0005), np.log(0.008)))),
        blank=float(rng.uniform(0, 0.5)),
        lost=float(rng.uniform(0, 0.35)),
        missed=float(rng.uniform(0.02, 0.6)),
        strays=int(rng.integers(0, 70)),
        turned=float(np.radians(rng.choice([0.0, 0.1, 0.3]))),
    )


@dataclass(frozen=True)
class Look:
    """What one camera sees without error: z-depth (0: nothing) and faces (-1: nothing)."""

    depth: Float[np.ndarray, "h w"]
    face: Int[np.ndarray, "h w"]


def look(
    surfaces: Surfaces,
    K: Float[np.ndarray, "3 3"],
    camera_from_room: Float[np.ndarray, "4 4"],
    size: tuple[int, int] = SIZE,
) -> Look:
    """Cast a ray through every pixel."""
    room_from_camera = invert_rigid(camera_from_room)
    rays = pixel_rays(pixel_grid(size[1], size[0]), K).reshape(-1, 3) @ room_from_camera[:3, :3].T
    hits = cast(surfaces, room_from_camera[:3, 3], rays)
    shape = (size[1], size[0])
    return Look(hits.distance.reshape(shape), hits.face.reshape(shape))


def blank_faces(surfaces: Surfaces, errors: Errors, rng: np.random.Generator) -> np.ndarray:
    """Tell which faces have no texture, for all views alike."""
    return np.asarray(rng.uniform(size=len(surfaces) * FACES) < errors.blank)


def measured_depth(
    seen: Look, blank: np.ndarray, errors: Errors, rng: np.random.Generator
) -> Float[np.ndarray, "h w"]:
    """Return depth with smooth and fine errors, blank faces and losses."""
    height, width = seen.depth.shape
    coarse = rng.normal(size=(6, 8))
    smooth = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    noise = errors.rough * smooth + errors.fine * rng.normal(size=seen.depth.shape)
    blobs = cv2.resize(rng.uniform(size=(9, 12)), (width, height), interpolation=cv2.INTER_LINEAR)
    threshold = np.quantile(blobs, errors.lost)
    bare = blank[np.maximum(seen.face, 0)] & (rng.uniform(size=seen.depth.shape) > 0.1)
    return np.where(bare | (blobs < threshold), 0.0, seen.depth * (1 + noise))


def measured_segments(
    segments: Float[np.ndarray, "n 4"],
    size: tuple[int, int],
    errors: Errors,
    rng: np.random.Generator,
) -> Float[np.ndarray, "m 4"]:
    """Return segments as a detector finds them: broken, displaced, some missed, some stray."""
    unit = size[0] / PHOTO_WIDTH
    kept = segments[rng.uniform(size=len(segments)) > errors.missed]
    ends = np.sort(rng.uniform(0, 1, (len(kept), 2)) ** [[2.0, 0.5]], axis=1)
    start, span = kept[:, :2], kept[:, 2:] - kept[:, :2]
    kept = np.concatenate([start + span * ends[:, :1], start + span * ends[:, 1:]], axis=1)
    middle = rng.uniform(0, 1, (errors.strays, 2)) * size
    angle = rng.uniform(0, np.pi, errors.strays)
    reach = np.stack([np.cos(angle), np.sin(angle)], axis=1) * size[0]
    reach *= rng.uniform(0.02, 0.08, (errors.strays, 1))
    kept = np.concatenate([kept, np.concatenate([middle - reach, middle + reach], axis=1)])
    kept = kept + rng.normal(0, ENDPOINT_PX * unit, kept.shape)
    length = np.hypot(kept[:, 2] - kept[:, 0], kept[:, 3] - kept[:, 1])
    return kept[length > MIN_LENGTH * np.hypot(*size)]
