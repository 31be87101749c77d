"""Procedural rooms: exact geometry and gravity, cheap, apart by split."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from garden_models.geometry.rotation import axis_angle
from garden_models.gravity.training.scenes.edges import all_edges, seen_segments
from garden_models.gravity.training.scenes.furnish import RoomKind
from garden_models.gravity.training.scenes.observe import (
    observe,
    photographed,
    training_scene,
)
from garden_models.gravity.training.scenes.photographer import PhotographerKind
from garden_models.gravity.training.scenes.sensing import Errors
from garden_models.gravity.training.scenes.surfaces import Surfaces, cast
from garden_models.gravity.training.splits import SPLITS

EXACT = Errors(0.0, 0.0, 0.0, 0.0, 0.0, 0, 0.0)
LEVEL = PhotographerKind(photos=6, roll_deg=0.0)
FLAT = RoomKind(planes=True, slanted=False)


def one_of_each() -> Surfaces:
    return Surfaces(
        np.array([[0.0, 0, 5]]),
        axis_angle(np.array([0, 0, 1.0]), np.pi / 4)[None],
        np.array([[1.0, 1, 1]]),
        np.array([[0.0, 0, 10]]),
        np.array([[[6.0, 0, 0], [0, 6, 0]]]),
        np.array([[3.0, 0, 5]]),
        np.eye(3)[None],
        np.array([[0.5, 0.5, 0.25]]),
    )


def test_rays_stop_at_the_first_surface():
    rays = np.array([[0, 0, 1.0], [2.9, 2.9, 10], [0.6, 0, 1], [0, 0, -1], [4, 0, 10]])
    hits = cast(one_of_each(), np.zeros(3), rays)
    assert hits.distance[0] == pytest.approx(4)  # the box
    assert hits.face[0] // 6 == 0
    assert hits.distance[1] == pytest.approx(1)  # past it, to the panel
    assert hits.face[1] // 6 == 1
    on_ball = (rays[2] * hits.distance[2] - [3, 0, 5]) / [0.5, 0.5, 0.25]
    assert np.linalg.norm(on_ball) == pytest.approx(1)
    assert on_ball @ rays[2] < 0  # its near side
    assert hits.face[2] // 6 == 2
    assert (hits.face[3:] == -1).all()
    assert (hits.distance[3:] == 0).all()


def test_the_same_scene_is_the_same_and_no_split_shares_one():
    scenes = [training_scene(split, 3) for split in SPLITS]
    again = training_scene("train", 3)
    np.testing.assert_array_equal(scenes[0][0].normal, again[0].normal)
    np.testing.assert_array_equal(scenes[0][1], again[1])
    for a, b in ((0, 1), (0, 2), (1, 2)):
        assert not np.allclose(scenes[a][1], scenes[b][1])


@pytest.mark.parametrize("seed", range(4))
def test_without_errors_floors_face_up_exactly(seed):
    rng = np.random.default_rng(seed)
    shot = dataclasses.replace(photographed(rng, FLAT, LEVEL), errors=EXACT)
    evidence = observe(shot, rng)
    up = evidence.normal[evidence.normal_weight > 0] @ -shot.down_world
    assert (up > 0.9999).any() or (np.abs(up) < 1e-4).any()
    level = evidence.rotation[:, 0] @ shot.down_world
    assert np.abs(level).max() < np.sin(np.radians(25))


def test_edges_are_seen_where_they_are():
    """Every segment of an exact view lies in the plane of one of the room's edges."""
    rng = np.random.default_rng(1)
    shot = dataclasses.replace(photographed(rng, FLAT, LEVEL), errors=EXACT)
    from garden_models.gravity.training.scenes.sensing import look
    from garden_models.gravity.vanishing_points import lift

    edges = all_edges(shot.room.surfaces, rng)
    direction = edges[:, 1] - edges[:, 0]
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    for camera in shot.camera_from_room:
        seen = look(shot.room.surfaces, shot.K, camera)
        segments = seen_segments(edges, seen.depth, shot.K, camera)
        assert len(segments)
        planes, _, _ = lift(segments, shot.K, camera[:3, :3], (64, 48))
        assert np.abs(planes @ direction.T).min(axis=1).max() < 1e-6
        assert (segments >= 0).all()
        assert (segments <= [64, 48, 64, 48]).all()


def test_errors_are_as_large_as_they_say():
    rng = np.random.default_rng(2)
    shot = photographed(rng, FLAT, LEVEL, turned=np.radians(1.0))
    off = [
        np.degrees(np.arccos((np.trace(a[:3, :3] @ b[:3, :3].T) - 1) / 2))
        for a, b in zip(
            shot.camera_from_world[:, :3, :3] @ shot.camera_from_world[0, :3, :3].T,
            shot.camera_from_room[:, :3, :3] @ shot.camera_from_room[0, :3, :3].T,
            strict=True,
        )
    ]
    assert 0.1 < np.max(off) < 6
