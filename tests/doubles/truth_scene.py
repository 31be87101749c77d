"""A scene's exact truth, for models that answer it in their own conventions.

Tells which photo a picture is, what each of its pixels shows and how deep, and which object a
mask or a box is of.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import cv2
import numpy as np
import trimesh

from garden_models.meshing.ray_casting import RayCaster
from tests.garden_models.meshing.staged import Staged, colour_of
from tests.scenes.corner_truth import load_corner

THUMBNAIL = (48, 36)


@dataclass(frozen=True)
class TruthCamera:
    """One photo with its exact camera (OpenCV, pixel centres at +0.5), metres."""

    rgb: np.ndarray
    K: np.ndarray
    camera_from_world: np.ndarray

    @cached_property
    def thumbnail(self) -> np.ndarray:
        return thumbnail(self.rgb)

    def scaled_K(self, size: tuple[int, int]) -> np.ndarray:  # noqa: N802
        height, width = self.rgb.shape[:2]
        return np.diag([size[0] / width, size[1] / height, 1.0]) @ self.K


@dataclass(frozen=True)
class TruthBody:
    """One object: closed mesh in its upright frame (y down), and where it stands (rigid)."""

    name: str
    vertices: np.ndarray
    faces: np.ndarray
    rgb: np.ndarray
    world_from_object: np.ndarray


@dataclass(frozen=True)
class Picture:
    """What every pixel shows: z-depth (metres, 0: nothing) and the body's index (-1: none)."""

    depth: np.ndarray
    owner: np.ndarray


class TruthScene:
    """Cameras, bodies, and all else as one mesh."""

    def __init__(
        self,
        cameras: list[TruthCamera],
        bodies: list[TruthBody],
        rest: tuple[np.ndarray, np.ndarray],
    ) -> None:
        self.cameras, self.bodies = cameras, bodies
        parts = [(placed(body), body.faces) for body in bodies] + [rest]
        starts = np.cumsum([0] + [len(v) for v, _ in parts])
        vertices = np.concatenate([v for v, _ in parts])
        faces = np.concatenate([f + s for (_, f), s in zip(parts, starts, strict=False)])
        self._owner = np.repeat([*range(len(bodies)), -1], [len(f) for _, f in parts])
        self._caster = RayCaster(vertices, faces)
        self._pictures: dict[tuple[int, tuple[int, int]], Picture] = {}

    def camera_of(self, rgb: np.ndarray) -> int:
        """Return which photo a picture of any size is."""
        small = thumbnail(rgb)
        apart = [float(np.abs(camera.thumbnail - small).mean()) for camera in self.cameras]
        best = int(np.argmin(apart))
        assert apart[best] < 12.0, f"the picture is none of the photos (nearest: {apart[best]:.1f})"
        return best

    def picture(self, camera: int, size: tuple[int, int]) -> Picture:
        """Return what the pixels of a photo resized to ``size`` (width, height) show."""
        key = camera, size
        if key not in self._pictures:
            self._pictures[key] = self._cast(self.cameras[camera], size)
        return self._pictures[key]

    def body_of(self, camera: int, mask: np.ndarray) -> int:
        """Return the body of which a mask shows most."""
        owner = self.picture(camera, (mask.shape[1], mask.shape[0])).owner[mask]
        counts = np.bincount(owner[owner >= 0], minlength=len(self.bodies))
        assert counts.max() > 0.5 * mask.sum(), "the mask is of no single object"
        return int(counts.argmax())

    def camera_from_object(self, camera: int, body: int) -> np.ndarray:
        """Return the exact rigid pose (4x4) of a body in a photo's OpenCV camera, metres."""
        extrinsic = np.vstack([self.cameras[camera].camera_from_world[:3], [0, 0, 0, 1]])
        return extrinsic @ self.bodies[body].world_from_object

    def _cast(self, camera: TruthCamera, size: tuple[int, int]) -> Picture:
        width, height = size
        y, x = np.mgrid[0:height, 0:width]
        pixels = np.stack([x + 0.5, y + 0.5, np.ones_like(x, float)], -1).reshape(-1, 3)
        rotation, shift = camera.camera_from_world[:3, :3], camera.camera_from_world[:3, 3]
        rays = pixels @ np.linalg.inv(camera.scaled_K(size)).T @ rotation
        centre = -rotation.T @ shift
        hits = self._caster.cast(np.tile(centre, (len(rays), 1)), rays)
        hit = hits.face >= 0
        depth = np.where(hit, hits.distance, 0.0).reshape(height, width)
        owner = np.where(hit, self._owner[hits.face], -1).reshape(height, width)
        return Picture(depth, owner)


def thumbnail(rgb: np.ndarray) -> np.ndarray:
    return cv2.resize(rgb, THUMBNAIL, interpolation=cv2.INTER_AREA).astype(np.float32)


def placed(body: TruthBody) -> np.ndarray:
    """Return the body's vertices in the world."""
    pose = body.world_from_object
    return body.vertices @ pose[:3, :3].T + pose[:3, 3]


@lru_cache(maxsize=1)
def corner_scene() -> TruthScene:
    """Return the sample capture's truth."""
    corner = load_corner()
    return TruthScene(
        [TruthCamera(corner.photo(v.photo), v.K, v.camera_from_world) for v in corner.views],
        [
            TruthBody(o.name, o.vertices_object, o.faces, o.vertex_rgb, o.world_from_object)
            for o in corner.objects
        ],
        (corner.room_vertices_world, corner.room_faces),
    )


def staged_scene(staged: Staged, yaw_gv: np.ndarray | None = None) -> TruthScene:
    """Return the truth of a staged capture: one object, in an object frame of its own heading.

    ``yaw_gv`` (3x3) turns the object frame to Gravity-View.
    """
    turn = np.eye(3) if yaw_gv is None else yaw_gv
    low, high = staged.truth.bounds
    foot = np.array([0.5 * (low[0] + high[0]), high[1], 0.5 * (low[2] + high[2])])
    gv_from_object = np.eye(4)
    gv_from_object[:3, :3], gv_from_object[:3, 3] = turn, foot
    world_from_gv = np.linalg.inv(staged.gravity_view.gv_from_world)
    fine = staged.truth.subdivide_to_size(0.012)
    body = TruthBody(
        "thing",
        (fine.vertices - foot) @ turn,
        np.asarray(fine.faces),
        colour_of(fine.vertices),
        world_from_gv @ gv_from_object,
    )
    table = trimesh.creation.box([4.0, 0.02, 4.0])
    table.apply_translation([0.0, high[1] + 0.01, 0.0])
    table.apply_transform(world_from_gv)
    cameras = [TruthCamera(v.rgb, v.K, v.camera_from_world) for v in staged.reconstruction.views]
    return TruthScene(cameras, [body], (np.asarray(table.vertices), np.asarray(table.faces)))
