"""Hand features and matches to COLMAP: its database, cameras' first guess, verified pairs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pycolmap
from jaxtyping import Int

from garden_models.reconstruction.registration_features import Features
from garden_models.reconstruction.registration_matching import Pair
from garden_models.scene import Photo

DEFAULT_FOCAL = 1.2
"""Focal length over the longer side where EXIF gives none (about 45 degrees, COLMAP's)."""


def shared_intrinsics(photos: Sequence[Photo]) -> list[int]:
    """Return for each photo the index of its camera: same size and same EXIF focal length.

    Focal lengths that differ by less than 1 % count as one (they are rounded in EXIF).
    """
    cameras: list[tuple[tuple[int, int], float | None]] = []
    index = []
    for photo in photos:
        size = (photo.rgb.shape[1], photo.rgb.shape[0])
        for known, (other_size, other_focal) in enumerate(cameras):
            same_focal = photo.focal_px == other_focal or (
                photo.focal_px is not None
                and other_focal is not None
                and abs(photo.focal_px - other_focal) < 0.01 * other_focal
            )
            if size == other_size and same_focal:
                index.append(known)
                break
        else:
            index.append(len(cameras))
            cameras.append((size, photo.focal_px))
    return index


def first_guess(photo: Photo, camera_id: int, model: str) -> pycolmap.Camera:
    """Return COLMAP's camera of a photo before anything is known but EXIF."""
    height, width = photo.rgb.shape[:2]
    focal = photo.focal_px or DEFAULT_FOCAL * max(width, height)
    camera = pycolmap.Camera.create_from_model_name(camera_id, model, focal, width, height)
    camera.has_prior_focal_length = photo.focal_px is not None
    return camera


def first_guesses(photos: Sequence[Photo], model: str) -> tuple[list[pycolmap.Camera], list[int]]:
    """Return the cameras that photos share, and for each photo the index of its camera."""
    camera_of_photo = shared_intrinsics(photos)
    cameras = [
        first_guess(photos[camera_of_photo.index(k)], k + 1, model)
        for k in range(max(camera_of_photo) + 1)
    ]
    return cameras, camera_of_photo


def write_database(
    path: Path,
    photos: Sequence[Photo],
    cameras: Sequence[pycolmap.Camera],
    camera_of_photo: Sequence[int],
    features: Sequence[Features],
    matches: Mapping[Pair, Int[np.ndarray, "m 2"]],
) -> None:
    """Write a new COLMAP database; photo i gets image, frame id i + 1."""
    path.unlink(missing_ok=True)
    with pycolmap.Database.open(path) as database:
        for camera in cameras:
            database.write_camera(camera, use_camera_id=True)
            rig = pycolmap.Rig(rig_id=camera.camera_id)
            rig.add_ref_sensor(camera.sensor_id)
            database.write_rig(rig, use_rig_id=True)
        for index, (photo, found) in enumerate(zip(photos, features, strict=True)):
            camera_id = cameras[camera_of_photo[index]].camera_id
            image = pycolmap.Image(
                name=photo.name, camera_id=camera_id, image_id=index + 1, keypoints=np.zeros((0, 2))
            )
            database.write_image(image, use_image_id=True)
            frame = pycolmap.Frame(frame_id=index + 1, rig_id=camera_id)
            frame.add_data_id(image.data_id)
            database.write_frame(frame, use_frame_id=True)
            database.write_keypoints(index + 1, found.keypoints)
        for (i, j), pairs in matches.items():
            database.write_matches(i + 1, j + 1, pairs)


def verify_pairs(path: Path, seed: int, threads: int, min_inlier_ratio: float = 0.0) -> None:
    """Keep the matches that agree with one epipolar geometry or homography per pair.

    Each pair's RANSAC starts from ``seed``, so the result does not depend on threads.
    """
    geometry = pycolmap.TwoViewGeometryOptions(min_inlier_ratio=min_inlier_ratio)
    geometry.ransac.random_seed = seed
    pycolmap.geometric_verification(
        path,
        verifier_options=pycolmap.GeometricVerifierOptions(num_threads=threads),
        two_view_geometry_options=geometry,
    )
