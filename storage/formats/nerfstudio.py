"""Read and write cameras as nerfstudio's ``transforms.json`` (camera to world, OpenGL axes)."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from storage.formats.errors import UnreadableInput
from storage.formats.limits import read_json
from storage.formats.posed_camera import PosedCamera

OPENCV_FROM_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])
LENSES = ("PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "PERSPECTIVE")


def read_transforms(path: Path) -> tuple[tuple[PosedCamera, ...], tuple[Path, ...]]:
    """Return the cameras of a ``transforms.json`` and the photo files it names.

    Photos must be named inside the file's folder: what was downloaded must not pick files
    from elsewhere into a report that is passed on; a link that the user made there may lead
    anywhere. Raises UnreadableInput naming the file and what is wrong in it.
    """
    cameras, names = _read(path)
    return cameras, tuple(_inside(path, name) for name in names)


def read_transforms_cameras(path: Path) -> tuple[PosedCamera, ...]:
    """Return the cameras of a ``transforms.json`` whose photos are given otherwise."""
    return _read(path)[0]


def _read(path: Path) -> tuple[tuple[PosedCamera, ...], tuple[str, ...]]:
    """Return the cameras and the photos' names as written.

    ``applied_transform`` is undone, so that the world is the one before nerfstudio's
    reorientation.
    """
    try:
        document = read_json(path)
        frames = list(document["frames"])
    except UnreadableInput:
        raise
    except FileNotFoundError:
        raise UnreadableInput(f"no such file: {path}; check the path") from None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise UnreadableInput(
            f"{path} is no nerfstudio transforms.json ({error!r}): it needs a list `frames`"
        ) from None
    cameras, names = [], []
    for i, frame in enumerate(frames):
        try:
            cameras.append(_camera({**document, **frame}, _undo_applied(document)))
            names.append(str(frame["file_path"]))
        except UnreadableInput:
            raise
        except (KeyError, TypeError, ValueError, np.linalg.LinAlgError) as error:
            raise UnreadableInput(
                f"frame {i} of {path} cannot be read ({error!r}): it needs file_path, a 4x4 "
                "transform_matrix, w, h, fl_x, cx and cy"
            ) from None
    return tuple(cameras), tuple(names)


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
    if not all(np.isfinite(part).all() for part in (world_from_camera, K, distortion)):
        raise ValueError("a number is not finite")
    return PosedCamera(
        Path(values["file_path"]).name,
        (int(values["w"]), int(values["h"])),
        K,
        distortion,
        np.linalg.inv(world_from_camera)[:3],
    )


def _inside(path: Path, photo: str) -> Path:
    """Return the photo that a file names, which must lie in the file's folder or below."""
    folder = Path(os.path.normpath(path.parent.absolute()))
    place = Path(os.path.normpath(folder / photo))
    if "\0" in photo or not place.is_relative_to(folder):
        raise UnreadableInput(
            f"{path} names {photo!r}, which lies outside its folder: move the file above the "
            "photos, link their folder beside it, or give the photos' folder as the capture "
            f"and the file with --cameras {path}"
        )
    return place


def _undo_applied(document: Mapping[str, Any]) -> Float[np.ndarray, "4 4"]:
    applied = document.get("applied_transform")
    if applied is None:
        return np.eye(4)
    return np.linalg.inv(np.vstack([np.array(applied, float)[:3], [0, 0, 0, 1]]))
