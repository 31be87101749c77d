"""Read Virtual KITTI 2: ``Scene01/<variation>/{extrinsic,intrinsic}.txt`` and ``frames/``.

Extrinsics are world to camera (OpenCV) in a world whose y points down; depth is in centimetres.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float

from garden_models.gravity.training.datasets.sequence import PosedSequence, checked_rotations
from garden_models.scene import BadInput

DOWN_WORLD = np.array([0.0, 1.0, 0.0])
CENTIMETRE = 0.01
SKY = 65535


def read_vkitti2(root: Path) -> list[PosedSequence]:
    """Return every scene, variation and camera of a folder, a sequence each.

    Raises BadInput if there is none or one is broken.
    """
    files = sorted(root.glob("**/extrinsic.txt"))
    if not files:
        raise BadInput(f"{root}: no extrinsic.txt, so this is no Virtual KITTI 2 folder")
    return [sequence for path in files for sequence in _read(path)]


def _read(extrinsic: Path) -> list[PosedSequence]:
    poses = _table(extrinsic, 2 + 16)
    focals = _table(extrinsic.with_name("intrinsic.txt"), 2 + 4)
    if not np.array_equal(poses[:, :2], focals[:, :2]):
        raise BadInput(f"{extrinsic}: its frames and cameras are not those of intrinsic.txt")
    frames = extrinsic.parent / "frames"
    found = []
    for camera in np.unique(poses[:, 1]).astype(int):
        own = poses[:, 1] == camera
        numbers = poses[own, 0].astype(int)
        matrices = poses[own, 2:].reshape(-1, 4, 4)
        checked_rotations(matrices[:, :3, :3], extrinsic)
        K = np.zeros((len(numbers), 3, 3))
        K[:, 0, 0], K[:, 1, 1], K[:, 0, 2], K[:, 1, 2] = focals[own, 2:].T
        K[:, 2, 2] = 1
        name = f"{'/'.join(extrinsic.parent.parts[-2:])}/Camera_{camera}"
        found.append(
            PosedSequence(
                name,
                tuple(frames / "rgb" / f"Camera_{camera}" / f"rgb_{n:05d}.jpg" for n in numbers),
                tuple(
                    frames / "depth" / f"Camera_{camera}" / f"depth_{n:05d}.png" for n in numbers
                ),
                matrices[:, :3],
                DOWN_WORLD,
                K,
                read_depth,
            )
        )
    return found


def _table(path: Path, columns: int) -> np.ndarray:
    try:
        rows = np.loadtxt(path, skiprows=1, ndmin=2)
    except (OSError, ValueError) as error:
        raise BadInput(f"{path}: {error}") from error
    if rows.shape[1] != columns:
        raise BadInput(f"{path}: rows of {rows.shape[1]} numbers, expected {columns}")
    return rows


def read_depth(path: Path) -> Float[np.ndarray, "h w"]:
    """Return z-depth in metres, 0 where the sky is. Raises BadInput for another file."""
    raw = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if raw is None or raw.dtype != np.uint16:
        raise BadInput(f"{path} is no 16-bit depth picture")
    return np.where(raw < SKY, raw, 0) * CENTIMETRE
