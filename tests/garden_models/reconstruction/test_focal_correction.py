"""The focal length from matches and given poses: found where wrong, untouched where right."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from garden_models.geometry.camera import pixel_rays, project
from garden_models.geometry.rotation import axis_angle
from garden_models.reconstruction.focal_correction import (
    FocalCorrection,
    correct_focal,
    correction_remark,
    with_focal_factor,
)
from garden_models.reconstruction.known_cameras import RayMatches, relative_pose
from garden_models.reconstruction.registration import Registration, register
from garden_models.reconstruction.registration_config import LADDER, FocalTrust, Look
from garden_models.scene import Capture, KnownCamera, Photo, SparseModel

from .textured_room import look_at, room_capture

CAPTURES = Path(__file__).resolve().parents[4] / "shared" / "captures"
TRUST = FocalTrust()
TRUE_PX, SIZE = 500.0, (640, 480)
QUICK = Registration(ladder=(replace(LADDER[0], look=Look(1000)),))


def arc(count: int, radius: float = 1.5) -> list[np.ndarray]:
    """Return ``camera_from_world`` of cameras on a rising arc around the origin."""
    angles = np.linspace(-0.6, 0.6, count)
    return [
        look_at(
            np.array([radius * np.sin(a), -0.4 + 0.3 * np.sin(3 * a), -radius * np.cos(a)]),
            np.array([0.1 * np.cos(5 * a), 0.1 * np.sin(4 * a), 0.2]),
        )
        for a in angles
    ]


def turning(count: int, shift_m: float) -> list[np.ndarray]:
    """Return cameras that turn in one place, up to ``shift_m``."""
    rng = np.random.default_rng(5)
    return [
        look_at(
            np.array([0.0, 0.0, -1.5]) + shift_m * rng.normal(size=3),
            np.array([0.5 * np.sin(a), 0.2 * np.cos(3 * a), 0.0]),
        )
        for a in np.linspace(-0.8, 0.8, count)
    ]


def rig_matches(
    poses: Sequence[np.ndarray],
    given_px: float,
    noise_px: float = 0.0,
    points: int = 150,
    wrong: float = 0.0,
) -> list[RayMatches]:
    """Return what cameras of focal length ``TRUE_PX`` see, as rays of the given one.

    A share ``wrong`` of the matches joins points at random.
    """
    rng = np.random.default_rng(0)
    xyz_world = rng.uniform(-0.7, 0.7, (points, 3))
    K, given_K = (
        np.array([[f, 0, SIZE[0] / 2], [0, f, SIZE[1] / 2], [0, 0, 1]]) for f in (TRUE_PX, given_px)
    )
    known = [KnownCamera(f"{i}.png", given_K, pose) for i, pose in enumerate(poses)]
    rays = []
    for pose in poses:
        pixels, _ = project(xyz_world, K, pose)
        rays.append(pixel_rays(pixels + noise_px * rng.normal(size=pixels.shape), given_K)[:, :2])
    found = []
    for i in range(len(poses)):
        for j in range(i + 1, len(poses)):
            partner = np.arange(points)
            lost = rng.random(points) < wrong
            partner[lost] = rng.permutation(partner[lost])
            pair = relative_pose(known[i], known[j])
            found.append(RayMatches((i, j), rays[i], rays[j][partner], pair, given_px, 2.56))
    return found


@pytest.mark.parametrize("share", [0.8, 0.9, 1.1, 1.25])
@pytest.mark.parametrize("noise_px", [0.0, 0.5])
def test_a_wrong_focal_length_is_found_within_one_percent(share: float, noise_px: float) -> None:
    found = correct_focal(rig_matches(arc(6), share * TRUE_PX, noise_px, wrong=0.1), TRUST)
    assert found is not None
    assert share * found.factor == pytest.approx(1.0, abs=0.01)
    assert found.error_px < 0.8 * found.given_error_px


@pytest.mark.parametrize("noise_px", [0.0, 0.5, 1.5])
def test_a_true_focal_length_stands(noise_px: float) -> None:
    assert correct_focal(rig_matches(arc(6), TRUE_PX, noise_px, wrong=0.1), TRUST) is None


def test_a_focal_length_as_good_as_calibrations_are_stands() -> None:
    assert correct_focal(rig_matches(arc(6), 1.015 * TRUE_PX, 0.5), TRUST) is None


@pytest.mark.parametrize("shift_m", [0.0, 0.002])
@pytest.mark.parametrize("share", [0.9, 1.0, 1.1])
def test_a_camera_that_only_turns_tells_nothing(shift_m: float, share: float) -> None:
    matches = rig_matches(turning(6, shift_m), share * TRUE_PX, 0.5)
    assert correct_focal(matches, TRUST) is None


def test_moving_straight_without_turning_tells_nothing() -> None:
    """All scales keep the epipolar lines of a camera that moves along its axes."""
    poses = [np.hstack([np.eye(3), [[-0.2 * i], [0.0], [1.5]]]) for i in range(5)]
    assert correct_focal(rig_matches(poses, 1.1 * TRUE_PX, 0.5), TRUST) is None


def test_few_matches_or_pairs_tell_nothing() -> None:
    assert correct_focal(rig_matches(arc(3), 1.1 * TRUE_PX, points=20), TRUST) is None
    assert correct_focal(rig_matches(arc(2), 1.1 * TRUE_PX), TRUST) is None
    assert correct_focal([], TRUST) is None


@pytest.mark.parametrize("seed", range(5))
def test_inexact_poses_are_not_taken_for_a_wrong_focal_length(seed: int) -> None:
    """Errors of single poses move the best factor, but differently without some photos."""
    rng = np.random.default_rng(seed)
    poses = arc(5)
    matches = rig_matches(poses, TRUE_PX, 0.5)
    jittered = []
    for pose in poses:
        rotation = axis_angle(rng.normal(size=3), np.radians(0.5)) @ pose[:, :3]
        centre = -pose[:, :3].T @ pose[:, 3] + 0.01 * rng.normal(size=3)
        jittered.append(np.hstack([rotation, (-rotation @ centre)[:, None]]))
    known = [KnownCamera(f"{i}.png", np.eye(3), pose) for i, pose in enumerate(jittered)]
    moved = [replace(m, b_from_a=relative_pose(*(known[k] for k in m.photos))) for m in matches]
    assert correct_focal(moved, TRUST) is None


def test_cameras_of_other_photos_are_not_repaired() -> None:
    poses = arc(6)
    matches = rig_matches(poses, TRUE_PX)
    other = rig_matches(poses[::-1], TRUE_PX)
    mixed = [
        replace(a, b_from_a=np.linalg.inv(b.b_from_a)) for a, b in zip(matches, other, strict=True)
    ]
    assert correct_focal(mixed, TRUST) is None


def test_the_lens_moves_pixels_as_before() -> None:
    distortion = np.array([-0.2, 0.05, 0.003, -0.002])
    K = np.array([[500.0, 0, 320], [0, 510.0, 240], [0, 0, 1]])
    camera = KnownCamera("a.png", K, np.eye(3, 4), distortion)
    scaled = with_focal_factor(camera, 0.9)
    assert np.allclose(scaled.K[:2, 2], K[:2, 2])
    straight = np.random.default_rng(0).uniform((0, 0), SIZE, (50, 2))
    bent, again = (
        cv2.projectPoints(pixel_rays(straight, c.K), np.zeros(3), np.zeros(3), c.K, c.distortion)[0]
        for c in (camera, scaled)
    )
    assert np.abs(bent[:, 0] - straight).max() > 1
    assert np.allclose(bent, again, atol=1e-9)


def test_the_remark_speaks_in_pixels_of_the_photo_file() -> None:
    K = np.array([[585.0, 0, 320], [0, 585.0, 240], [0, 0, 1]])
    photo = Photo("a.png", np.zeros((480, 640, 3), np.uint8), (1280, 960))
    camera = KnownCamera("a.png", K, np.eye(3, 4))
    remark = correction_remark(FocalCorrection(0.9, 2.1, 0.8), [camera], [photo])
    assert remark.startswith(
        "the given focal length 1170 px disagrees with the photos; 1053 px used"
    )
    assert "0.8 instead of 2.1 px" in remark and "correct_focal=false" in remark


def wrong_room(factor: float) -> Capture:
    room = room_capture(6)
    return Capture(room.photos, tuple(with_focal_factor(c, factor) for c in room.cameras))


def assert_kept_to_the_bit(model: SparseModel, given: Sequence[KnownCamera]) -> None:
    for camera, kept in zip(given, model.cameras, strict=True):
        assert np.array_equal(kept.K, camera.K)
        assert np.array_equal(kept.distortion, camera.distortion)
        assert np.allclose(kept.camera_from_world, camera.camera_from_world, atol=1e-9)
    assert model.verdict.reasons == ()


def test_registration_uses_the_corrected_focal_length_and_says_so(tmp_path: Path) -> None:
    capture = wrong_room(1.1)
    model = register(capture, QUICK, tmp_path)
    true = room_capture(6).cameras[0].K
    assert model.cameras[0].K[0, 0] == pytest.approx(true[0, 0], rel=0.01)
    assert model.verdict.status == "ok"
    assert "363 px disagrees with the photos" in model.verdict.reasons[0]
    assert model.verdict.reasons[0] in model.attempts[0].note
    for given, kept in zip(capture.cameras, model.cameras, strict=True):
        assert np.allclose(kept.camera_from_world, given.camera_from_world, atol=1e-9)


def test_registration_keeps_a_true_focal_length_to_the_bit(tmp_path: Path) -> None:
    capture = room_capture(6)
    assert_kept_to_the_bit(register(capture, QUICK, tmp_path), capture.cameras)


def test_the_correction_can_be_turned_off(tmp_path: Path) -> None:
    capture = wrong_room(1.1)
    model = register(capture, replace(QUICK, correct_focal=False), tmp_path)
    assert np.array_equal(model.cameras[0].K, capture.cameras[0].K)


def given_capture(name: str) -> Capture:
    """Return a capture with its given cameras, or skip the test where it is not there."""
    folder = CAPTURES / name
    if not folder.is_dir():
        pytest.skip(f"{folder} is not there: captures with truth lie beside the project")
    photos, cameras = [], []
    for frame in json.loads((folder / "transforms.json").read_text())["frames"]:
        path = folder / frame["file_path"]
        rgb = cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2RGB)
        K = np.array([[frame["fl_x"], 0, frame["cx"]], [0, frame["fl_y"], frame["cy"]], [0, 0, 1]])
        world_from_camera = np.array(frame["transform_matrix"]) @ np.diag([1, -1, -1, 1])
        photos.append(Photo(path.name, rgb, (rgb.shape[1], rgb.shape[0])))
        cameras.append(KnownCamera(path.name, K, np.linalg.inv(world_from_camera)[:3]))
    return Capture(tuple(photos), tuple(cameras))


@pytest.mark.slow
def test_a_capture_with_another_cameras_focal_length_is_corrected(tmp_path: Path) -> None:
    """The file gives the depth camera's 585 px; the photos have about 525 px."""
    model = register(given_capture("redkitchen"), Registration(), tmp_path)
    assert 480 < model.cameras[0].K[0, 0] < 550
    assert model.verdict.status == "ok" and "585 px disagrees" in model.verdict.reasons[0]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["arkit_corridor", "livingroom", "tum_fr3_office"])
def test_captures_with_right_cameras_keep_them_to_the_bit(name: str, tmp_path: Path) -> None:
    capture = given_capture(name)
    assert_kept_to_the_bit(register(capture, Registration(), tmp_path), capture.cameras)
