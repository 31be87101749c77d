"""Triangulate sparse points from cameras that the user gave; their poses stay fixed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pycolmap
from jaxtyping import Float

from garden_models.geometry.rigid import homogeneous, invert_rigid
from garden_models.reconstruction.registration_config import CameraTrust
from garden_models.scene import KnownCamera, Photo, Verdict

MAX_EPIPOLAR_SHARE = 0.004
"""Distance of a match from its epipolar line, over the photo's longer side, up to which it
agrees with the given cameras (4 pixels of 1000, as much as the matches' own check allows)."""


def opencv_camera(known: KnownCamera, photo: Photo, camera_id: int) -> pycolmap.Camera:
    """Return COLMAP's camera of a known one."""
    height, width = photo.rgb.shape[:2]
    K = known.K
    return pycolmap.Camera(
        model="OPENCV",
        width=width,
        height=height,
        params=[K[0, 0], K[1, 1], K[0, 2], K[1, 2], *known.distortion],
        camera_id=camera_id,
        has_prior_focal_length=True,
    )


def triangulate(
    known: Sequence[KnownCamera],
    photos: Sequence[Photo],
    database: Path,
    folder: Path,
    seed: int,
    threads: int,
) -> pycolmap.Reconstruction:
    """Return COLMAP's model of the photos with known cameras; photo i has image id i + 1.

    ``known[i]`` belongs to ``photos[i]``; the database must use the same ids.
    """
    model = pycolmap.Reconstruction()
    for index, (camera, photo) in enumerate(zip(known, photos, strict=True), start=1):
        model.add_camera_with_trivial_rig(opencv_camera(camera, photo, index))
        image = pycolmap.Image(
            name=photo.name, camera_id=index, image_id=index, keypoints=np.zeros((0, 2))
        )
        pose = camera.camera_from_world
        model.add_image_with_trivial_frame(
            image, pycolmap.Rigid3d(pycolmap.Rotation3d(pose[:, :3]), pose[:, 3])
        )
    folder.mkdir(parents=True, exist_ok=True)
    options = pycolmap.IncrementalPipelineOptions()
    options.extract_colors = False
    options.random_seed = seed
    options.num_threads = threads
    return pycolmap.triangulate_points(model, database, folder, folder, options=options)


@dataclass(frozen=True)
class RayMatches:
    """Verified matches of two photos, as rays (x, y at depth 1) of their given cameras.

    ``photos`` are their indices among the known cameras, ``focal_px`` is the shorter focal
    length of the two, ``limit_px`` the epipolar error from which a match contradicts the
    cameras, both in pixels of the ingested photos.
    """

    photos: tuple[int, int]
    rays_a: Float[np.ndarray, "n 2"]
    rays_b: Float[np.ndarray, "n 2"]
    b_from_a: Float[np.ndarray, "4 4"]
    focal_px: float
    limit_px: float


def ray_matches(
    known: Sequence[KnownCamera], photos: Sequence[Photo], database: Path
) -> list[RayMatches]:
    """Return the verified matches of every pair of photos that has some.

    ``known[i]`` belongs to ``photos[i]``, which has image id i + 1 in the database.
    """
    cameras = [
        opencv_camera(camera, photo, i + 1)
        for i, (camera, photo) in enumerate(zip(known, photos, strict=True))
    ]
    with pycolmap.Database.open(database) as opened:
        keypoints = [opened.read_keypoints(i + 1)[:, :2] for i in range(len(photos))]
        pair_ids, geometries = opened.read_two_view_geometries()
    found = []
    for pair_id, geometry in zip(pair_ids, geometries, strict=True):
        i, j = (image_id - 1 for image_id in pycolmap.pair_id_to_image_pair(pair_id))
        matches = geometry.inlier_matches
        if len(matches) == 0:
            continue
        found.append(
            RayMatches(
                (i, j),
                cameras[i].cam_from_img(keypoints[i][matches[:, 0]].astype(np.float64)),
                cameras[j].cam_from_img(keypoints[j][matches[:, 1]].astype(np.float64)),
                relative_pose(known[i], known[j]),
                float(min(known[i].K[0, 0], known[j].K[0, 0])),
                MAX_EPIPOLAR_SHARE * max(photos[i].rgb.shape[:2]),
            )
        )
    return found


def agreement(pairs: Sequence[RayMatches]) -> tuple[float, int]:
    """Return the share of verified matches near their epipolar line, and their number."""
    agreeing = total = 0
    for pair in pairs:
        error = epipolar_error(pair.rays_a, pair.rays_b, pair.b_from_a)
        agreeing += int((error < pair.limit_px / pair.focal_px).sum())
        total += len(error)
    return (agreeing / total if total else 0.0), total


def relative_pose(a: KnownCamera, b: KnownCamera) -> Float[np.ndarray, "4 4"]:
    """Return ``b_from_a``."""
    return homogeneous(b.camera_from_world) @ invert_rigid(a.camera_from_world)


def epipolar_error(
    a: Float[np.ndarray, "n 2"], b: Float[np.ndarray, "n 2"], b_from_a: Float[np.ndarray, "4 4"]
) -> Float[np.ndarray, " n"]:
    """Return Sampson's distance of normalised image points from their epipolar lines."""
    x, y, z = b_from_a[:3, 3]
    E = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ b_from_a[:3, :3]
    ones = np.ones((len(a), 1))
    ray_a, ray_b = np.hstack([a, ones]), np.hstack([b, ones])
    line_b, line_a = ray_a @ E.T, ray_b @ E
    gradient = (line_b[:, :2] ** 2).sum(1) + (line_a[:, :2] ** 2).sum(1)
    return np.abs((ray_b * line_b).sum(1)) / np.sqrt(np.maximum(gradient, 1e-30))


def judge_agreement(share: float, matches: int, trust: CameraTrust) -> Verdict:
    """Return the verdict on given cameras of which ``share`` of the matches approve."""
    if matches == 0:
        return Verdict(
            "failed",
            (
                "no two photos with given cameras share matching points; take photos that "
                "overlap by more than half",
            ),
        )
    if share >= trust.degraded_below:
        return Verdict()
    reason = (
        f"only {share:.0%} of {matches} matching points between photos agree with the given "
        "cameras; check that the file of cameras belongs to these photos, or leave it out"
    )
    return Verdict("failed" if share < trust.failed_below else "degraded", (reason,))
