"""Read Hypersim: ``ai_001_001/{_detail,images}`` (HDF5; needs the package ``h5py``).

Poses are camera to world with OpenGL camera axes (x right, y up, z backward) in a world whose z
points up, in asset units. ``depth_meters`` is the distance from the camera centre, not z-depth.
"""

from __future__ import annotations

import csv
import importlib
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from garden_models.geometry.camera import pixel_grid, pixel_rays
from garden_models.gravity.training.datasets.sequence import (
    PosedSequence,
    camera_from_pose,
    checked_rotations,
)
from garden_models.scene import BadInput

OPENCV_FROM_OPENGL = np.diag([1.0, -1.0, -1.0])
DOWN_WORLD = np.array([0.0, 0.0, -1.0])
SIZE = (1024, 768)
FOCAL = SIZE[0] / 2 / np.tan(np.pi / 6)
"""Pixels: the horizontal field of view is 60 degrees in scenes without lens shift."""


def read_hypersim(root: Path) -> list[PosedSequence]:
    """Return every camera path of a folder of scenes.

    Raises BadInput if there is none, one is broken, or h5py is not installed.
    """
    folders = sorted(root.glob("**/_detail/cam_*/camera_keyframe_orientations.hdf5"))
    if not folders:
        raise BadInput(
            f"{root}: no _detail/cam_*/camera_keyframe_orientations.hdf5, so this is no Hypersim "
            "folder"
        )
    return [_read(path.parent) for path in folders]


def _read(camera: Path) -> PosedSequence:
    scene = camera.parents[1]
    axes = _dataset(camera / "camera_keyframe_orientations.hdf5").astype(np.float64)
    centres = _dataset(camera / "camera_keyframe_positions.hdf5").astype(np.float64)
    numbers = _dataset(camera / "camera_keyframe_frame_indices.hdf5").astype(int)
    if not len(axes) == len(centres) == len(numbers):
        raise BadInput(
            f"{camera}: {len(axes)} orientations, {len(centres)} positions and {len(numbers)} "
            "frame indices"
        )
    checked_rotations(axes, camera)
    metres = metres_per_asset_unit(scene / "_detail" / "metadata_scene.csv")
    cameras = camera_from_pose(axes @ OPENCV_FROM_OPENGL, centres * metres)
    images = scene / "images"
    preview = images / f"scene_{camera.name}_final_preview"
    geometry = images / f"scene_{camera.name}_geometry_hdf5"
    # Frames that were withdrawn have a pose but no picture.
    kept = [k for k, n in enumerate(numbers) if (preview / f"frame.{n:04d}.tonemap.jpg").is_file()]
    K = np.array([[FOCAL, 0, SIZE[0] / 2], [0, FOCAL, SIZE[1] / 2], [0, 0, 1]])
    return PosedSequence(
        f"{scene.name}/{camera.name}",
        tuple(preview / f"frame.{numbers[k]:04d}.tonemap.jpg" for k in kept),
        tuple(geometry / f"frame.{numbers[k]:04d}.depth_meters.hdf5" for k in kept),
        cameras[kept],
        DOWN_WORLD,
        np.broadcast_to(K, (len(kept), 3, 3)),
        partial(read_depth, K=K),
    )


def metres_per_asset_unit(path: Path) -> float:
    """Read the scene's unit. Raises BadInput if it is not stated."""
    try:
        with path.open(newline="") as file:
            rows = {
                row["parameter_name"].strip(): row["parameter_value"]
                for row in csv.DictReader(file)
            }
        value = float(rows["meters_per_asset_unit"])
    except (OSError, KeyError, ValueError, TypeError) as error:
        raise BadInput(f"{path}: meters_per_asset_unit cannot be read ({error})") from error
    if not value > 0:
        raise BadInput(f"{path}: meters_per_asset_unit is {value}")
    return value


def read_depth(path: Path, K: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "h w"]:
    """Return z-depth in metres from distances along the rays, 0 where there is nothing."""
    distance = _dataset(path).astype(np.float64)
    height, width = distance.shape
    factor = np.diag([width / SIZE[0], height / SIZE[1], 1.0])
    rays = pixel_rays(pixel_grid(height, width), factor @ K)
    depth = distance / np.linalg.norm(rays, axis=-1)
    return np.where(np.isfinite(depth), depth, 0.0)


def _dataset(path: Path) -> np.ndarray:
    try:
        h5py: Any = importlib.import_module("h5py")
    except ImportError as error:
        raise BadInput("reading Hypersim needs the package h5py: pip install h5py") from error
    try:
        with h5py.File(path, "r") as file:
            return np.asarray(file["dataset"])
    except (OSError, KeyError) as error:
        raise BadInput(f"{path}: {error}") from error
