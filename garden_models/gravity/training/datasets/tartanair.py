"""Read TartanAir: ``ENV/{Easy,Hard}/P000/{image_left,depth_left,pose_left.txt}``.

Poses are camera to world in NED (camera: x forward, y right, z down; world: z down), so gravity
is the world's +z.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Float

from garden_models.geometry.rotation import matrix_from_quaternion
from garden_models.gravity.training.datasets.sequence import PosedSequence, camera_from_pose
from garden_models.scene import BadInput

OPENCV_FROM_NED = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])
DOWN_WORLD = np.array([0.0, 0.0, 1.0])
K = np.array([[320.0, 0, 320], [0, 320.0, 240], [0, 0, 1]])
"""The same for all photos, 640 x 480 pixels."""
SKY_M = 5000.0
"""Depth from which it is the sky (stored near 10,000 m)."""


def read_tartanair(root: Path) -> list[PosedSequence]:
    """Return every path of a TartanAir folder.

    Raises BadInput if there is none or one is broken.
    """
    files = sorted(root.glob("**/pose_left.txt"))
    if not files:
        raise BadInput(f"{root}: no pose_left.txt, so this is no TartanAir folder")
    return [_read(path) for path in files]


def _read(poses: Path) -> PosedSequence:
    rows = np.loadtxt(poses, ndmin=2)
    photos = tuple(sorted((poses.parent / "image_left").glob("*_left.png")))
    if rows.shape[1:] != (7,) or len(rows) != len(photos):
        raise BadInput(
            f"{poses}: {len(rows)} poses of {rows.shape[1]} numbers for {len(photos)} photos in "
            "image_left; there must be one pose of 7 numbers a photo"
        )
    norms = np.linalg.norm(rows[:, 3:], axis=1)
    if np.abs(norms - 1).max() > 1e-2:
        raise BadInput(f"{poses}: pose {int(np.abs(norms - 1).argmax())} holds no unit quaternion")
    ned = np.stack([matrix_from_quaternion(np.roll(row[3:], 1)) for row in rows])
    depths = tuple(poses.parent / "depth_left" / f"{photo.stem}_depth.npy" for photo in photos)
    return PosedSequence(
        "/".join(poses.parent.parts[-3:]),
        photos,
        depths,
        camera_from_pose(ned @ OPENCV_FROM_NED.T, rows[:, :3]),
        DOWN_WORLD,
        np.broadcast_to(K, (len(photos), 3, 3)),
        read_depth,
    )


def read_depth(path: Path) -> Float[np.ndarray, "h w"]:
    """Return z-depth in metres, 0 where the sky is."""
    depth = np.load(path, allow_pickle=False).astype(np.float64)
    return np.where(np.isfinite(depth) & (depth < SKY_M), depth, 0.0)
