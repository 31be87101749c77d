"""Read a capture's truth: ``cameras.json`` and ``depth/`` beside the photos."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float
from PIL import Image

from flows.wrong_use import WrongUse
from garden_models.geometry.rigid import invert_rigid

MILLIMETRE = 0.001


@dataclass(frozen=True)
class TrueCameras:
    """True cameras by photo name (OpenCV, metres) and the true up in their world.

    ``up_in_transforms`` is the same direction in the world of the capture's own
    ``transforms.json``, where that differs.
    """

    photos: tuple[str, ...]
    K: Float[np.ndarray, "n 3 3"]
    camera_from_world: Float[np.ndarray, "n 3 4"]
    sizes: tuple[tuple[int, int], ...]
    up_world: Float[np.ndarray, "3"]
    up_in_transforms: Float[np.ndarray, "3"]


def read_true_cameras(folder: Path) -> TrueCameras:
    """Read ``folder/cameras.json``; raise WrongUse if there is none."""
    path = folder / "cameras.json"
    if not path.is_file():
        raise WrongUse(f"{folder} has no cameras.json, so there is no truth to compare with")
    document = json.loads(path.read_text("utf-8"))
    frames = document["frames"]
    poses = [invert_rigid(np.array(frame["c2w"], float))[:3] for frame in frames]
    up = np.array(document["world_up"], float)
    return TrueCameras(
        tuple(Path(frame["file"]).name for frame in frames),
        np.stack([np.array(frame["K"], float) for frame in frames]),
        np.stack(poses),
        tuple((int(frame["w"]), int(frame["h"])) for frame in frames),
        up / np.linalg.norm(up),
        np.array(document.get("up_in_transforms_json", up), float),
    )


def read_true_depth(folder: Path, photo: str) -> Float[np.ndarray, "h w"] | None:
    """Read the true z-depth of a photo in metres (0 = none), or None if there is no file."""
    path = folder / "depth" / f"{Path(photo).stem}.png"
    if not path.is_file():
        return None
    document = json.loads((folder / "cameras.json").read_text("utf-8"))
    raw = np.asarray(Image.open(path)).astype(np.float64)
    raw[raw >= 65535] = 0
    return raw * float(document.get("depth_metres_per_unit", MILLIMETRE))
