"""Read and write cameras as nerfstudio's ``transforms.json`` (camera to world, OpenGL axes)."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from storage.formats.errors import UnreadableInput
from storage.formats.posed_camera import PosedCamera

OPENCV_FROM_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])
LENSES = ("PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "PERSPECTIVE")


def is_transforms(path: Path) -> bool:
    """Tell whether a file is a nerfstudio ``transforms.json`` by its name."""
    return path.suffix.lower() == ".json" and path.name.startswith("transforms")


def read_transforms(path: Path) -> tuple[tuple[PosedCamera, ...], tuple[Path, ...]]:
    """Return the cameras of a ``transforms.json`` and the photo files it names.

    ``applied_transform`` is undone, so that the world is the one before nerfstudio's
    reorientation. Raises UnreadableInput naming the file and what is wrong in it.
    """
    try:
        document = json.loads(path.read_text("utf-8"))
        frames = document["frames"]
    except FileNotFoundError:
        raise UnreadableInput(f"no such file: {path}; check the path") from None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise UnreadableInput(
            f"{path} is no nerfstudio transforms.json ({error!r}): it needs a list `frames`"
        ) from None
    undo = _undo_applied(document)
    cameras, photos = [], []
    for i, frame in enumerate(frames):
        try:
            cameras.append(_camera({**document, **frame}, undo))
            photos.append(path.parent / frame["file_path"])
        except (KeyError, TypeError, ValueError, np.linalg.LinAlgError) as error:
            raise UnreadableInput(
                f"frame {i} of {path} cannot be read ({error!r}): it needs file_path, a 4x4 "
                "transform_matrix, w, h, fl_x, cx and cy"
            ) from None
    return tuple(cameras), tuple(photos)


def transforms_json(
    photos: Sequence[str],
    sizes: Sequence[tuple[int, int]],
    intrinsics: Float[np.ndarray, "n 3 3"],
    camera_from_world: Float[np.ndarray, "n 3 4"],
) -> dict[str, Any]:
    """Return the document for pinhole cameras (OpenCV axes in, OpenGL axes out)."""
    frames = []
    for photo, (width, height), K, pose in zip(
        photos, sizes, intrinsics, camera_from_world, strict=True
    ):
        world_from_camera = np.linalg.inv(np.vstack([pose, [0, 0, 0, 1]]))
        frames.append(
            {
                "file_path": f"images/{photo}",
                "w": int(width),
                "h": int(height),
                "fl_x": float(K[0, 0]),
                "fl_y": float(K[1, 1]),
                "cx": float(K[0, 2]),
                "cy": float(K[1, 2]),
                "transform_matrix": (world_from_camera @ OPENCV_FROM_OPENGL).tolist(),
            }
        )
    return {"camera_model": "PINHOLE", "frames": frames}


def _camera(values: Mapping[str, Any], undo_applied: Float[np.ndarray, "4 4"]) -> PosedCamera:
    lens = str(values.get("camera_model", "OPENCV"))
    if lens not in LENSES or any(float(values.get(k, 0) or 0) for k in ("k3", "k4")):
        raise UnreadableInput(
            f"the lens model {lens} with k3 or k4 is not supported: undistort the photos first"
        )
    world_from_opengl = np.array(values["transform_matrix"], float)
    if world_from_opengl.shape == (3, 4):
        world_from_opengl = np.vstack([world_from_opengl, [0, 0, 0, 1]])
    world_from_camera = undo_applied @ world_from_opengl @ OPENCV_FROM_OPENGL
    focal_x = float(values["fl_x"])
    K = np.array(
        [
            [focal_x, 0, float(values["cx"])],
            [0, float(values.get("fl_y", focal_x)), float(values["cy"])],
            [0, 0, 1],
        ]
    )
    distortion = np.array([float(values.get(k, 0) or 0) for k in ("k1", "k2", "p1", "p2")])
    return PosedCamera(
        Path(values["file_path"]).name,
        (int(values["w"]), int(values["h"])),
        K,
        distortion,
        np.linalg.inv(world_from_camera)[:3],
    )


def _undo_applied(document: Mapping[str, Any]) -> Float[np.ndarray, "4 4"]:
    applied = document.get("applied_transform")
    if applied is None:
        return np.eye(4)
    return np.linalg.inv(np.vstack([np.array(applied, float)[:3], [0, 0, 0, 1]]))
