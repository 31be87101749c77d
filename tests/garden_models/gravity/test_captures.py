"""Gravity with given cameras, on the sample capture and on captures with truth beside the project.

No depth is estimated here: the sample's points are the true ones of a few views, the other
captures go by line segments and camera axes alone.
"""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from garden_models.geometry.camera import backproject_depth, resize_intrinsics
from garden_models.geometry.plane import local_normals
from garden_models.geometry.rotation import angle_between_deg
from garden_models.gravity.align import align_gravity
from garden_models.scene import PointCloud, Reconstruction, Scale, View
from tests.scenes.corner_truth import load_corner

CAPTURES = Path(__file__).resolve().parents[4] / "shared" / "captures"
LONG_SIDE = 504


def photo_view(path: Path, K: np.ndarray, camera_from_world: np.ndarray) -> View:
    """Return the photo at the working size, without depth."""
    rgb = cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2RGB)
    old = (rgb.shape[1], rgb.shape[0])
    factor = LONG_SIDE / max(old)
    new = (round(old[0] * factor), round(old[1] * factor))
    empty = np.zeros((new[1], new[0]))
    small = cv2.resize(rgb, new, interpolation=cv2.INTER_AREA)
    return View(
        path.name, small, empty, empty, resize_intrinsics(K, old, new), camera_from_world, old
    )


def reconstruct(views: list[View], xyz: np.ndarray) -> Reconstruction:
    normal = local_normals(xyz) if len(xyz) else xyz
    grey = np.full((len(xyz), 3), 128, np.uint8)
    cloud = PointCloud(xyz, grey, normal, np.full(len(xyz), 0.02), np.ones(len(xyz)))
    return Reconstruction(
        tuple(views), cloud, xyz[:100], (), Scale("known_cameras"), cameras_source="known"
    )


def test_sample_capture() -> None:
    corner = load_corner()
    views = [photo_view(corner.images / v.photo, v.K, v.camera_from_world) for v in corner.views]
    points = []
    for view in corner.views:
        if view.has_depth:
            truth = corner.depths[view.photo]
            lifted = backproject_depth(truth.depth, truth.K, view.camera_from_world)
            points.append(lifted[::8, ::8][truth.depth[::8, ::8] > 0])
    with_points = align_gravity(reconstruct(views, np.concatenate(points)))
    assert angle_between_deg(with_points.down_world, corner.down_world) < 0.3
    photos_alone = align_gravity(reconstruct(views, np.zeros((0, 3))))
    assert angle_between_deg(photos_alone.down_world, corner.down_world) < 0.7


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["arkit_corridor", "livingroom", "tum_fr3_office"])
def test_captures_with_given_cameras(scene: str) -> None:
    folder = CAPTURES / scene
    if not folder.is_dir():
        pytest.skip(f"{folder} is not there: captures with truth lie beside the project")
    truth = json.loads((folder / "cameras.json").read_text())
    views = []
    for frame in json.loads((folder / "transforms.json").read_text())["frames"]:
        K = np.array([[frame["fl_x"], 0, frame["cx"]], [0, frame["fl_y"], frame["cy"]], [0, 0, 1]])
        world_from_camera = np.array(frame["transform_matrix"]) @ np.diag([1, -1, -1, 1])
        camera_from_world = np.linalg.inv(world_from_camera)[:3]
        views.append(photo_view(folder / frame["file_path"], K, camera_from_world))
    view = align_gravity(reconstruct(views, np.zeros((0, 3))))
    error = angle_between_deg(view.down_world, -np.array(truth["up_in_transforms_json"]))
    assert error < 2
    assert error < 3 * view.sigma_deg
