"""Readers of the paper's data sets, on tiny folders of their formats with known cameras."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import cv2
import numpy as np
import pytest

from garden_models.geometry.camera import pixel_grid, pixel_rays
from garden_models.geometry.rotation import axis_angle, quaternion_from_matrix
from garden_models.gravity.training.datasets.read import read_dataset
from garden_models.gravity.training.datasets.sequence import PosedSequence
from garden_models.gravity.training.windows import Windows, windows_of
from garden_models.scene import BadInput

PITCH, YAW = np.radians(25.0), 0.8
CENTRE = np.array([1.0, -2.0, 1.5])
"""In a world of x east, y north, z up, metres."""
LEVEL_EAST = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])
"""Rows: the axes of a level OpenCV camera that looks east (x is south, y down, z east)."""


def camera_from_up() -> np.ndarray:
    """Return an OpenCV camera that looks ``YAW`` left of east and ``PITCH`` down."""
    left = axis_angle(np.array([0, 0, 1.0]), YAW)
    down = axis_angle(np.array([1.0, 0, 0]), PITCH)
    return down @ LEVEL_EAST @ left.T


def expected_gravity() -> np.ndarray:
    """Gravity in that camera: down and, as it looks down, a little forward."""
    return np.array([0.0, np.cos(PITCH), np.sin(PITCH)])


def check(sequence: PosedSequence, photos: int) -> None:
    assert len(sequence) == photos
    gravity = sequence.camera_from_world[:, :3, :3] @ sequence.down_world
    np.testing.assert_allclose(gravity, np.tile(expected_gravity(), (photos, 1)), atol=1e-5)
    true = sequence.gv_from_camera()
    np.testing.assert_allclose(true[:, 1], gravity, atol=1e-9)
    np.testing.assert_allclose(true[:, 0] @ [0, 0, 1], 0, atol=1e-6)
    centre = -np.einsum(
        "nji,nj->ni", sequence.camera_from_world[:, :, :3], sequence.camera_from_world[:, :, 3]
    )
    steps = np.diff(centre, axis=0)
    # The second photo is taken a metre ahead, whatever the world's axes are called.
    ahead = sequence.camera_from_world[0, :3, :3] @ steps[0]
    np.testing.assert_allclose(ahead, [0, 0, 1], atol=1e-5)


def test_the_test_camera_looks_down():
    np.testing.assert_allclose(camera_from_up() @ [0, 0, -1], expected_gravity(), atol=1e-12)
    forward = camera_from_up()[2]
    assert forward[2] == pytest.approx(-np.sin(PITCH))
    assert np.arctan2(forward[1], forward[0]) == pytest.approx(YAW)


@pytest.fixture
def tartanair(tmp_path: Path) -> Path:
    folder = tmp_path / "office" / "Easy" / "P000"
    (folder / "image_left").mkdir(parents=True)
    (folder / "depth_left").mkdir()
    # NED: the world is north, east, down; the camera forward, right, down.
    ned_from_up = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
    x, y, z = camera_from_up()
    axes = ned_from_up @ np.stack([z, x, y], axis=1)
    rows = []
    for k in range(2):
        at = ned_from_up @ (CENTRE + k * z)
        rows.append([*at, *np.roll(quaternion_from_matrix(axes), -1)])
        cv2.imwrite(str(folder / "image_left" / f"{k:06d}_left.png"), np.zeros((8, 8, 3), np.uint8))
        depth = np.array([[2.5, 10000.0], [np.inf, 3.0]], np.float32)
        np.save(folder / "depth_left" / f"{k:06d}_left_depth.npy", depth)
    np.savetxt(folder / "pose_left.txt", rows)
    return tmp_path


def test_tartanair_is_ned_and_its_sky_has_no_depth(tartanair):
    (sequence,) = read_dataset("tartanair", tartanair)
    check(sequence, 2)
    assert sequence.name == "office/Easy/P000"
    np.testing.assert_array_equal(sequence.read_depth(sequence.depths[0]), [[2.5, 0], [0, 3]])
    np.testing.assert_array_equal(sequence.K[0], [[320, 0, 320], [0, 320, 240], [0, 0, 1]])


def test_tartanair_with_a_pose_too_few_is_refused(tartanair):
    poses = next(tartanair.rglob("pose_left.txt"))
    poses.write_text(poses.read_text().splitlines()[0] + "\n")
    with pytest.raises(BadInput, match="1 poses of 7 numbers for 2 photos"):
        read_dataset("tartanair", tartanair)


@pytest.fixture
def vkitti2(tmp_path: Path) -> Path:
    folder = tmp_path / "Scene01" / "clone"
    # A world of east, down, north: y down.
    world_from_up = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    rotation = camera_from_up() @ world_from_up.T
    extrinsic = ["frame cameraID r1,1 r1,2 r1,3 t1 r2,1 r2,2 r2,3 t2 r3,1 r3,2 r3,3 t3 0 0 0 1"]
    intrinsic = ["frame cameraID K[0,0] K[1,1] K[0,2] K[1,2]"]
    for frame in range(2):
        for camera in range(2):
            at = world_from_up @ (CENTRE + frame * camera_from_up()[2])
            pose = np.eye(4)
            pose[:3, :3], pose[:3, 3] = rotation, -rotation @ at
            extrinsic.append(f"{frame} {camera} " + " ".join(map(str, pose.ravel())))
            intrinsic.append(f"{frame} {camera} 725.0087 725.0087 620.5 187")
            depth = folder / "frames" / "depth" / f"Camera_{camera}"
            depth.mkdir(parents=True, exist_ok=True)
            raw = np.array([[250, 65535], [0, 1000]], np.uint16)
            cv2.imwrite(str(depth / f"depth_{frame:05d}.png"), raw)
    (folder / "extrinsic.txt").write_text("\n".join(extrinsic))
    (folder / "intrinsic.txt").write_text("\n".join(intrinsic))
    return tmp_path


def test_vkitti2_is_world_to_camera_with_y_down_in_centimetres(vkitti2):
    sequences = read_dataset("vkitti2", vkitti2)
    assert [s.name for s in sequences] == ["Scene01/clone/Camera_0", "Scene01/clone/Camera_1"]
    for sequence in sequences:
        check(sequence, 2)
        np.testing.assert_allclose(sequence.read_depth(sequence.depths[1]), [[2.5, 0], [0, 10]])
        assert sequence.K[0][0, 0] == pytest.approx(725.0087)
    assert sequences[1].photos[1].parts[-2:] == ("Camera_1", "rgb_00001.jpg")


def test_vkitti2_with_a_pose_that_is_no_rotation_is_refused(vkitti2):
    path = next(vkitti2.rglob("extrinsic.txt"))
    lines = path.read_text().splitlines()
    numbers = lines[1].split()
    numbers[2] = "5.0"
    path.write_text("\n".join([lines[0], " ".join(numbers), *lines[2:]]))
    with pytest.raises(BadInput, match="pose 0 holds no rotation"):
        read_dataset("vkitti2", vkitti2)


@pytest.fixture
def hypersim(tmp_path: Path) -> Path:
    h5py = pytest.importorskip("h5py")
    scene = tmp_path / "ai_001_001"
    camera = scene / "_detail" / "cam_00"
    camera.mkdir(parents=True)
    preview = scene / "images" / "scene_cam_00_final_preview"
    geometry = scene / "images" / "scene_cam_00_geometry_hdf5"
    preview.mkdir(parents=True)
    geometry.mkdir()
    (scene / "_detail" / "metadata_scene.csv").write_text(
        "parameter_name,parameter_value\nmeters_per_asset_unit,0.0254\n"
    )
    x, y, z = camera_from_up()
    axes = np.stack([x, -y, -z], axis=1)  # right, up, backward in a z-up world

    def save(path: Path, values: np.ndarray) -> None:
        with h5py.File(path, "w") as file:
            file["dataset"] = values

    centres = np.stack([CENTRE, CENTRE + 9, CENTRE + z]) / 0.0254
    save(camera / "camera_keyframe_orientations.hdf5", np.stack([axes] * 3))
    save(camera / "camera_keyframe_positions.hdf5", centres)
    save(camera / "camera_keyframe_frame_indices.hdf5", np.array([0, 3, 7]))
    for n in (0, 7):  # frame 3 was withdrawn
        cv2.imwrite(str(preview / f"frame.{n:04d}.tonemap.jpg"), np.zeros((6, 8, 3), np.uint8))
        focal = 4 / np.tan(np.pi / 6)
        K = np.array([[focal, 0, 4], [0, focal, 3], [0, 0, 1]])
        distance = 5.0 * np.linalg.norm(pixel_rays(pixel_grid(6, 8), K), axis=-1)
        distance[0, 0] = np.nan
        save(geometry / f"frame.{n:04d}.depth_meters.hdf5", distance.astype(np.float16))
    return tmp_path


def test_hypersim_is_z_up_opengl_in_asset_units_with_euclidean_depth(hypersim):
    (sequence,) = read_dataset("hypersim", hypersim)
    assert sequence.name == "ai_001_001/cam_00"
    check(sequence, 2)
    depth = sequence.read_depth(sequence.depths[1])
    assert depth[0, 0] == 0
    np.testing.assert_allclose(np.delete(depth.ravel(), 0), 5.0, rtol=2e-3)  # a wall ahead


def test_hypersim_without_its_unit_is_refused(hypersim):
    next(hypersim.rglob("metadata_scene.csv")).write_text("parameter_name,parameter_value\n")
    with pytest.raises(BadInput, match="meters_per_asset_unit"):
        read_dataset("hypersim", hypersim)


@pytest.mark.parametrize("name", ["tartanair", "vkitti2", "hypersim"])
def test_another_folder_is_refused(name, tmp_path):
    with pytest.raises(BadInput, match="so this is no"):
        read_dataset(name, tmp_path)
    with pytest.raises(BadInput, match="no such folder"):
        read_dataset(name, tmp_path / "missing")


def test_an_unknown_data_set_is_refused(tmp_path):
    with pytest.raises(BadInput, match="use one of tartanair, hypersim, vkitti2"):
        read_dataset("scannet", tmp_path)


def test_scenes_are_windows_inside_the_sequence():
    config = Windows(fewest=2, most=6, longest_stride=5, scenes=50)
    for photos in (2, 3, 40):
        found = windows_of(photos, config, 1)
        assert len(found) == 50
        for chosen in found:
            assert 2 <= len(chosen) <= 6
            assert chosen.min() >= 0
            assert chosen.max() < photos
            assert len(set(np.diff(chosen))) == 1
    assert windows_of(1, config, 1) == []
    again = [list(w) for w in windows_of(40, config, 1)]
    assert again == [list(w) for w in found]
    assert again != [list(w) for w in windows_of(40, dataclasses.replace(config), 2)]
