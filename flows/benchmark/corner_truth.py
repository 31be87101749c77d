"""Read the sample capture's exact truth into typed arrays.

Everything is in the metric world of ``truth/cameras.json``::

    corner = load_corner(Path("tests/scenes/corner"))
    duck = corner.object("duck")
    mask = corner.mask("duck", duck.target_photo)
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8


@dataclass(frozen=True)
class TruthView:
    """One photo's exact camera (OpenCV, pixel centres at +0.5, no distortion).

    ``size`` is (width, height) of the photo. ``has_depth`` tells whether a depth map exists.
    """

    photo: str
    size: tuple[int, int]
    K: Float[np.ndarray, "3 3"]
    world_from_camera: Float[np.ndarray, "4 4"]
    has_depth: bool

    @property
    def camera_from_world(self) -> Float[np.ndarray, "3 4"]:
        """Extrinsics (3x4)."""
        return np.linalg.inv(self.world_from_camera)[:3]


@dataclass(frozen=True)
class TruthDepth:
    """Exact z-depth in metres (0: none) with the camera matrix for its own size."""

    photo: str
    depth: Float[np.ndarray, "h w"]
    K: Float[np.ndarray, "3 3"]


@dataclass(frozen=True)
class TruthObject:
    """One object: closed mesh in its upright frame (y down, base in y = 0) and its pose.

    ``size_m`` is its extent along the object frame's axes. ``yaw_symmetric``: its yaw
    cannot be told from its shape. ``visible_share`` (0..1) and ``visible_box``
    ``(x0, y0, x1, y1)`` are by photo. The box of its target in ``target_photo`` is loose.
    """

    name: str
    vertices_object: Float[np.ndarray, "v 3"]
    faces: Int[np.ndarray, "f 3"]
    vertex_rgb: UInt8[np.ndarray, "v 3"]
    world_from_object: Float[np.ndarray, "4 4"]
    size_m: Float[np.ndarray, "3"]
    yaw_symmetric: bool
    supported_by: str
    touches: tuple[str, ...]
    visible_share: dict[str, float]
    visible_box: dict[str, tuple[int, int, int, int]]
    target_photo: str
    target_box: tuple[float, float, float, float]

    @property
    def vertices_world(self) -> Float[np.ndarray, "v 3"]:
        """The vertices where the object stands, metres."""
        pose = self.world_from_object
        return self.vertices_object @ pose[:3, :3].T + pose[:3, 3]


@dataclass(frozen=True)
class TruthSupport:
    """A horizontal surface: its corners in the world, counter-clockwise from above."""

    name: str
    kind: str
    height_above_floor_m: float
    outline_world: Float[np.ndarray, "k 3"]


@dataclass(frozen=True)
class CornerTruth:
    """The capture's folder and all that is known exactly about it.

    ``down_world`` is the unit vector of gravity. ``room_*`` is everything but the objects.
    """

    folder: Path
    views: tuple[TruthView, ...]
    down_world: Float[np.ndarray, "3"]
    objects: tuple[TruthObject, ...]
    supports: tuple[TruthSupport, ...]
    room_vertices_world: Float[np.ndarray, "v 3"]
    room_faces: Int[np.ndarray, "f 3"]

    @property
    def images(self) -> Path:
        """The folder of the photos."""
        return self.folder / "images"

    @property
    def targets(self) -> Path:
        """The file ``targets.json``, as a user would give it."""
        return self.folder / "targets.json"

    @property
    def transforms(self) -> Path:
        """The given-cameras file (nerfstudio's form), in the same metric world."""
        return self.folder / "truth" / "transforms.json"

    def view(self, photo: str) -> TruthView:
        """Return the camera of ``photo`` (a file name such as ``corner_03.jpg``)."""
        return next(view for view in self.views if view.photo == photo)

    def object(self, name: str) -> TruthObject:
        """Return the object called ``name``."""
        return next(item for item in self.objects if item.name == name)

    def support(self, name: str) -> TruthSupport:
        """Return the support called ``name`` (``floor`` or ``table``)."""
        return next(support for support in self.supports if support.name == name)

    def mask(self, name: str, photo: str) -> Bool[np.ndarray, "h w"]:
        """Return the visible pixels of an object, at the photo's size."""
        path = self.folder / "truth" / "masks" / name / f"{Path(photo).stem}.png"
        return _read_image(path, cv2.IMREAD_GRAYSCALE) > 0

    def photo(self, photo: str) -> UInt8[np.ndarray, "h w 3"]:
        """Return the photo as RGB."""
        return np.ascontiguousarray(_read_image(self.images / photo, cv2.IMREAD_COLOR)[..., ::-1])

    @cached_property
    def depths(self) -> dict[str, TruthDepth]:
        """Depth maps by photo, for the few photos that have one (half the photo's size)."""
        content = _read_json(self.folder / "truth" / "cameras.json")
        found = {}
        for frame in content["frames"]:
            if "depth" not in frame:
                continue
            steps = _read_image(self.folder / "truth" / frame["depth"], cv2.IMREAD_UNCHANGED)
            depth = steps.astype(np.float64) * content["depth_unit_m"]
            photo = Path(frame["file"]).name
            found[photo] = TruthDepth(photo, depth, np.array(frame["depth_K"]))
        return found


def load_corner(folder: Path) -> CornerTruth:
    """Read the capture in ``folder`` with all of its truth; photos are read on demand."""
    truth = folder / "truth"
    cameras = _read_json(truth / "cameras.json")
    listed = _read_json(truth / "objects.json")
    targets = {t["name"]: t for t in _read_json(folder / "targets.json")["targets"]}
    room = np.load(truth / "room.npz")
    return CornerTruth(
        folder=folder,
        views=tuple(_view(frame) for frame in cameras["frames"]),
        down_world=np.array(cameras["gravity_down"]),
        objects=tuple(_object(truth, o, targets[o["name"]]) for o in listed["objects"]),
        supports=tuple(
            TruthSupport(
                s["name"], s["kind"], s["height_above_floor_m"], np.array(s["outline_world"])
            )
            for s in listed["supports"]
        ),
        room_vertices_world=room["vertices_world"].astype(np.float64),
        room_faces=room["faces"].astype(np.int64),
    )


def _view(frame: dict[str, Any]) -> TruthView:
    return TruthView(
        photo=Path(frame["file"]).name,
        size=(frame["w"], frame["h"]),
        K=np.array(frame["K"]),
        world_from_camera=np.array(frame["c2w"]),
        has_depth="depth" in frame,
    )


def _object(truth: Path, listed: dict[str, Any], target: dict[str, Any]) -> TruthObject:
    mesh = np.load(truth / listed["mesh"])
    views = listed["views"]
    return TruthObject(
        name=listed["name"],
        vertices_object=mesh["vertices"].astype(np.float64),
        faces=mesh["faces"].astype(np.int64),
        vertex_rgb=mesh["vertex_rgb"],
        world_from_object=np.array(listed["world_from_object"]),
        size_m=np.array(listed["size_m"]),
        yaw_symmetric=listed["yaw_symmetric"],
        supported_by=listed["supported_by"],
        touches=tuple(listed["touches"]),
        visible_share={photo: v["visible_share"] for photo, v in views.items()},
        visible_box={photo: tuple(v["box"]) for photo, v in views.items() if v["box"]},
        target_photo=target["image"],
        target_box=tuple(target["box"]),
    )


def _read_json(path: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return content


def _read_image(path: Path, how: int) -> Any:
    image = cv2.imread(str(path), how)
    if image is None:
        raise FileNotFoundError(f"{path} is missing or unreadable: run tests/scenes/make_corner")
    return image
