"""Read and write COLMAP models (binary and text) through pycolmap."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pycolmap
from jaxtyping import Float, UInt8

from storage.formats.errors import UnreadableInput
from storage.formats.posed_camera import PosedCamera

LENSES = {
    "SIMPLE_PINHOLE": "f cx cy",
    "PINHOLE": "fx fy cx cy",
    "SIMPLE_RADIAL": "f cx cy k1",
    "RADIAL": "f cx cy k1 k2",
    "OPENCV": "fx fy cx cy k1 k2 p1 p2",
}


def read_model(folder: Path) -> tuple[PosedCamera, ...]:
    """Return the registered cameras of a COLMAP model, sorted by photo name.

    Raises UnreadableInput for a damaged model or a lens that has no OpenCV form.
    """
    try:
        model = pycolmap.Reconstruction(folder)
    except (RuntimeError, ValueError) as error:
        raise UnreadableInput(
            f"{folder} is no readable COLMAP model ({str(error).splitlines()[0]}): it needs "
            "cameras, images and points3D as .bin or .txt"
        ) from None
    cameras = []
    for image in model.images.values():
        if image.has_pose:
            cameras.append(_posed(image, folder))
    return tuple(sorted(cameras, key=lambda camera: camera.photo))


def colmap_model(
    photos: Sequence[str],
    sizes: Sequence[tuple[int, int]],
    intrinsics: Float[np.ndarray, "n 3 3"],
    camera_from_world: Float[np.ndarray, "n 3 4"],
    points_world: Float[np.ndarray, "m 3"],
    points_rgb: UInt8[np.ndarray, "m 3"] | None = None,
) -> dict[str, bytes]:
    """Return COLMAP's binary files by name: one pinhole camera per photo, points without tracks."""
    model = pycolmap.Reconstruction()
    colours = np.full((len(points_world), 3), 128, np.uint8) if points_rgb is None else points_rgb
    for i, (photo, size, K, pose) in enumerate(
        zip(photos, sizes, intrinsics, camera_from_world, strict=True), start=1
    ):
        camera = pycolmap.Camera(
            model="PINHOLE",
            width=int(size[0]),
            height=int(size[1]),
            params=[K[0, 0], K[1, 1], K[0, 2], K[1, 2]],
            camera_id=i,
        )
        model.add_camera_with_trivial_rig(camera)
        image = pycolmap.Image(name=photo, camera_id=i, image_id=i)
        pose_3d = pycolmap.Rigid3d(pycolmap.Rotation3d(pose[:, :3]), pose[:, 3])
        model.add_image_with_trivial_frame(image, pose_3d)
    for xyz, rgb in zip(points_world, colours, strict=True):
        model.add_point3D(xyz.astype(np.float64), pycolmap.Track(), rgb)
    with tempfile.TemporaryDirectory() as folder:
        model.write_binary(folder)
        return {path.name: path.read_bytes() for path in sorted(Path(folder).iterdir())}


def _posed(image: pycolmap.Image, folder: Path) -> PosedCamera:
    camera = image.camera
    lens = camera.model.name
    if lens not in LENSES:
        raise UnreadableInput(
            f"{folder} uses the lens model {lens}: undistort the photos first (COLMAP's "
            "image_undistorter)"
        )
    values = dict(zip(LENSES[lens].split(), camera.params, strict=True))
    focal = values.get("f", values.get("fx"))
    K = np.array([[focal, 0, values["cx"]], [0, values.get("fy", focal), values["cy"]], [0, 0, 1]])
    return PosedCamera(
        Path(image.name).name,
        (camera.width, camera.height),
        K.astype(np.float64),
        np.array([values.get(k, 0.0) for k in ("k1", "k2", "p1", "p2")]),
        np.asarray(image.cam_from_world().matrix(), np.float64),
    )
