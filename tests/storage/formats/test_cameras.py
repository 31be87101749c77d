"""Cameras survive a round trip through nerfstudio's and COLMAP's files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from storage.formats.cameras import camera_files, read_cameras
from storage.formats.colmap import colmap_model, read_model
from storage.formats.errors import UnreadableInput
from storage.formats.nerfstudio import read_transforms, transforms_json

NAMES = ["a.jpg", "b.jpg", "c.jpg"]
SIZES = [(64, 48)] * 3


def some_cameras() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    rotations = Rotation.random(3, random_state=1).as_matrix()
    poses = np.concatenate([rotations, rng.normal(size=(3, 3, 1))], axis=2)
    K = np.array([[50.0, 0, 31], [0, 51, 24], [0, 0, 1]])
    return np.stack([K] * 3), poses


def test_nerfstudio_round_trip(tmp_path: Path) -> None:
    K, poses = some_cameras()
    path = tmp_path / "transforms.json"
    path.write_text(json.dumps(transforms_json(NAMES, SIZES, K, poses)))
    cameras, photos = read_transforms(path)
    assert [p.name for p in photos] == NAMES
    for camera, pose in zip(cameras, poses, strict=True):
        np.testing.assert_allclose(camera.camera_from_world, pose, atol=1e-9)
        np.testing.assert_allclose(camera.K, K[0])


def test_nerfstudio_level_camera_looks_along_minus_z_of_opengl() -> None:
    identity = np.eye(4)[None, :3]
    document = transforms_json(["a.jpg"], [(64, 48)], np.eye(3)[None], identity)
    matrix = np.array(document["frames"][0]["transform_matrix"])
    np.testing.assert_allclose(-matrix[:3, 2], [0, 0, 1])
    np.testing.assert_allclose(matrix[:3, 1], [0, -1, 0])


def test_nerfstudio_applied_transform_is_undone(tmp_path: Path) -> None:
    K, poses = some_cameras()
    document = transforms_json(NAMES, SIZES, K, poses)
    applied = np.array([[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, -1, 0.5]])
    full = np.vstack([applied, [0, 0, 0, 1]])
    for frame in document["frames"]:
        frame["transform_matrix"] = (full @ np.array(frame["transform_matrix"])).tolist()
    document["applied_transform"] = applied.tolist()
    path = tmp_path / "transforms.json"
    path.write_text(json.dumps(document))
    for camera, pose in zip(read_transforms(path)[0], poses, strict=True):
        np.testing.assert_allclose(camera.camera_from_world, pose, atol=1e-9)


@pytest.mark.parametrize("text", ["{", "[]", '{"frames": [{}]}', '{"frames": [{"w": 1}]}'])
def test_a_damaged_transforms_file_is_named(tmp_path: Path, text: str) -> None:
    path = tmp_path / "transforms.json"
    path.write_text(text)
    with pytest.raises(UnreadableInput, match=r"transforms\.json"):
        read_transforms(path)


def test_fisheye_lenses_are_refused_with_the_remedy(tmp_path: Path) -> None:
    K, poses = some_cameras()
    document = transforms_json(NAMES, SIZES, K, poses) | {"camera_model": "OPENCV_FISHEYE"}
    path = tmp_path / "transforms.json"
    path.write_text(json.dumps(document))
    with pytest.raises(UnreadableInput, match="undistort"):
        read_transforms(path)


def test_colmap_round_trip(tmp_path: Path) -> None:
    K, poses = some_cameras()
    points = np.random.default_rng(0).normal(size=(5, 3))
    model = tmp_path / "sparse" / "0"
    model.mkdir(parents=True)
    for name, data in colmap_model(NAMES, SIZES, K, poses, points).items():
        (model / name).write_bytes(data)
    cameras = read_cameras(camera_files(tmp_path))
    assert [camera.photo for camera in cameras] == NAMES
    for camera, pose in zip(cameras, poses, strict=True):
        np.testing.assert_allclose(camera.camera_from_world, pose, atol=1e-9)
        np.testing.assert_allclose(camera.K, K[0])


def test_a_damaged_colmap_model_is_named(tmp_path: Path) -> None:
    (tmp_path / "cameras.bin").write_bytes(b"\xff" * 20)
    with pytest.raises(UnreadableInput, match="COLMAP"):
        read_model(tmp_path)
