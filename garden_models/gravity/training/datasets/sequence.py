"""Define what every data set gives: photos with poses in a world whose gravity is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from garden_models.geometry.gravity_view import gv_from_camera
from garden_models.scene import BadInput

ReadDepth = Callable[[Path], Float[np.ndarray, "h w"]]


@dataclass(frozen=True)
class PosedSequence:
    """Photos of one camera path: OpenCV cameras, metres, pixel centres at +0.5.

    ``down_world`` is gravity; ``depths`` are files that ``read_depth`` turns into z-depth in
    metres (0: none); ``K`` (for the photos' size) is None where a data set does not give it.
    """

    name: str
    photos: tuple[Path, ...]
    depths: tuple[Path, ...]
    camera_from_world: Float[np.ndarray, "n 3 4"]
    down_world: Float[np.ndarray, "3"]
    K: Float[np.ndarray, "n 3 3"] | None
    read_depth: ReadDepth

    def __len__(self) -> int:
        return len(self.photos)

    def gv_from_camera(self) -> Float[np.ndarray, "n 3 3"]:
        """Return the true rotation from every camera to its own Gravity-View."""
        rotations = self.camera_from_world[:, :3, :3]
        return np.stack([gv_from_camera(rotation @ self.down_world) for rotation in rotations])


def checked_rotations(
    rotations: Float[np.ndarray, "n 3 3"], source: Path
) -> Float[np.ndarray, "n 3 3"]:
    """Return rotations; raise BadInput for matrices that are none."""
    off = np.abs(rotations @ np.swapaxes(rotations, 1, 2) - np.eye(3)).max(axis=(1, 2))
    wrong = ~((off < 1e-3) & (np.linalg.det(rotations) > 0))
    if wrong.any():
        raise BadInput(f"{source}: pose {int(np.argmax(wrong))} holds no rotation")
    return rotations


def camera_from_pose(
    world_from_camera: Float[np.ndarray, "n 3 3"], centre: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "n 3 4"]:
    """Return ``camera_from_world`` of cameras given by their axes and centres in the world."""
    rotation = np.swapaxes(world_from_camera, 1, 2)
    translation = -np.einsum("nij,nj->ni", rotation, centre)
    return np.concatenate([rotation, translation[..., None]], axis=2)
