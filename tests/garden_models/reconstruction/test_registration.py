"""Registration end to end on ray-cast rooms: exact cameras, honest failures, same bits."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pycolmap
import pytest

from garden_models.geometry.camera import project
from garden_models.geometry.rigid import homogeneous, transform_points
from garden_models.metrics.camera_pose import camera_pose_errors
from garden_models.reconstruction.registration import Registration, badly_connected, register
from garden_models.reconstruction.registration_config import LADDER, Look
from garden_models.scene import BadInput, Capture, Photo, SparseModel

from .textured_room import SIZE, noise_texture, room_capture

QUICK = Registration(ladder=tuple(replace(rung, look=Look(1000)) for rung in LADDER[:2]))


@pytest.fixture(scope="module")
def room() -> Capture:
    return room_capture(6)


@pytest.fixture(scope="module")
def estimated(room: Capture, tmp_path_factory: pytest.TempPathFactory) -> SparseModel:
    return register(Capture(room.photos), QUICK, tmp_path_factory.mktemp("estimated"))


def unrelated_photo(seed: int) -> Photo:
    picture = noise_texture(1000 + seed, 512)[: SIZE[1], : SIZE[0]]
    return Photo(f"other{seed}.png", np.ascontiguousarray(picture), SIZE)


def poses(model: SparseModel) -> np.ndarray:
    return np.stack([camera.camera_from_world for camera in model.cameras])


def assert_tracks_project(model: SparseModel) -> None:
    """Every point lies in front of, and inside, each photo that is said to see it."""
    owner = np.repeat(np.arange(len(model.points_world)), np.diff(model.track_start))
    assert model.track_start[-1] == len(model.track_views)
    for index, camera in enumerate(model.cameras):
        seen = owner[model.track_views == index]
        pixels, depth = project(model.points_world[seen], camera.K, camera.camera_from_world)
        assert (depth > 0).all()
        assert (np.abs(pixels - np.array(camera.size) / 2) < np.array(camera.size) / 2 + 4).all()


def test_all_cameras_are_found_exactly(room: Capture, estimated: SparseModel) -> None:
    assert [camera.photo for camera in estimated.cameras] == [p.name for p in room.photos]
    assert estimated.verdict.status == "ok" and estimated.unregistered == ()
    true = np.stack([camera.camera_from_world for camera in room.cameras])
    errors = camera_pose_errors(poses(estimated), true)
    assert np.median(errors.rotation_deg) < 0.1
    assert errors.position.max() < 0.01
    focal = estimated.cameras[0].K[0, 0]
    assert focal == pytest.approx(room.cameras[0].K[0, 0], rel=0.01)


def test_points_tracks_and_colours_fit_the_photos(room: Capture, estimated: SparseModel) -> None:
    assert len(estimated.points_world) > 200
    assert_tracks_project(estimated)
    rgb = np.stack([photo.rgb for photo in room.photos])
    assert np.abs(estimated.points_rgb.mean(0) - rgb.mean((0, 1, 2))).max() < 20


def test_unknown_scale_is_stated_and_sets_the_median_depth(estimated: SparseModel) -> None:
    depths = [
        transform_points(camera.camera_from_world, estimated.points_world)[:, 2]
        for camera in estimated.cameras
    ]
    assert estimated.scale.source == "unknown" and "1.5 m" in estimated.scale.note
    assert 1.0 < np.median(depths) < 2.2


def test_attempts_are_recorded_and_one_is_chosen(estimated: SparseModel) -> None:
    assert [a.chosen for a in estimated.attempts].count(True) == 1
    assert estimated.attempts[-1].registered == 6


def test_the_same_photos_give_the_same_bits(
    room: Capture, estimated: SparseModel, tmp_path: Path
) -> None:
    again = register(Capture(room.photos), QUICK, tmp_path)
    assert np.array_equal(poses(again), poses(estimated))
    assert np.array_equal(again.points_world, estimated.points_world)
    assert np.array_equal(again.track_views, estimated.track_views)


def test_a_photo_of_something_else_is_named(room: Capture, tmp_path: Path) -> None:
    stranger = unrelated_photo(0)
    model = register(Capture((*room.photos[:5], stranger)), QUICK, tmp_path)
    assert model.unregistered == (stranger.name,)
    assert model.verdict.status == "degraded" and stranger.name in model.verdict.reasons[0]


def test_photos_without_overlap_fail_and_name_themselves(tmp_path: Path) -> None:
    photos = tuple(unrelated_photo(i) for i in range(4))
    ladder = tuple(replace(r, look=replace(r.look, features=500)) for r in LADDER)
    model = register(Capture(photos), Registration(ladder=ladder), tmp_path)
    assert model.verdict.status == "failed" and len(model.verdict.reasons) == 1
    assert all(photo.name in model.verdict.reasons[0] for photo in photos)
    assert model.cameras == () and len(model.attempts) == len(LADDER)


def test_photos_without_texture_fail(tmp_path: Path) -> None:
    grey = np.full((*SIZE[::-1], 3), 128, np.uint8)
    photos = tuple(Photo(f"grey{i}.png", grey, SIZE) for i in range(3))
    assert register(Capture(photos), QUICK, tmp_path).verdict.status == "failed"


def test_one_photo_is_refused(room: Capture, tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="at least 2"):
        register(Capture(room.photos[:1]), QUICK, tmp_path)


def test_known_cameras_are_kept_and_points_lie_on_the_walls(room: Capture, tmp_path: Path) -> None:
    model = register(room, QUICK, tmp_path)
    assert model.cameras_source == "known" and model.scale.source == "known_cameras"
    assert model.verdict.status == "ok"
    for given, kept in zip(room.cameras, model.cameras, strict=True):
        assert np.allclose(kept.camera_from_world, given.camera_from_world, atol=1e-9)
        assert np.allclose(kept.K, given.K)
    points = model.points_world
    distance = np.min(
        [np.abs(points[:, a] - c) for a, c in ((0, 2.0), (0, -2.0), (1, 1.2), (2, 3.0))], axis=0
    )
    assert np.median(distance) < 0.01
    assert_tracks_project(model)


def test_wrong_known_cameras_are_refused(room: Capture, tmp_path: Path) -> None:
    # Camera-to-world given as world-to-camera: the usual mistake.
    wrong = tuple(
        replace(c, camera_from_world=np.linalg.inv(homogeneous(c.camera_from_world))[:3])
        for c in room.cameras
    )
    model = register(Capture(room.photos, wrong), QUICK, tmp_path)
    assert model.verdict.status == "failed" and "given cameras" in model.verdict.reasons[0]


def test_photos_that_known_cameras_leave_out_are_named(room: Capture, tmp_path: Path) -> None:
    model = register(Capture(room.photos, room.cameras[:-1]), QUICK, tmp_path)
    assert model.unregistered == (room.photos[-1].name,)
    assert model.verdict.status == "degraded"


def test_nothing_placed_means_all_badly_connected() -> None:
    assert badly_connected(pycolmap.Reconstruction(), 3) == [0, 1, 2]
