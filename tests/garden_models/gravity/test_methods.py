"""Every cue answers on a plain room, and the baselines are what they say."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.geometry.rotation import angle_between_deg
from garden_models.gravity import (
    METHODS,
    manhattan_frame,
    normal_clustering,
    plane_ransac,
    read_cue,
)
from garden_models.scene import BadInput
from tests.garden_models.gravity.synthetic_room import Room, cameras_only, make_room

CUES = sorted(METHODS.keys() - {"mean_camera_up", "reference_camera", "view_decoder"})
"""Cameras always answer, and a decoder needs a checkpoint: these have tests of their own."""


@pytest.mark.parametrize("name", CUES)
def test_every_method_answers_on_a_plain_room(name: str) -> None:
    reconstruction, down = make_room(Room(seed=3))
    evidence = METHODS[name](reconstruction)
    assert evidence is not None
    assert evidence.method == name
    assert np.linalg.norm(evidence.down_world) == pytest.approx(1.0)
    assert angle_between_deg(evidence.down_world, down) < 4
    assert 0 < evidence.sigma_deg <= 90
    cue = read_cue(name, reconstruction)
    assert cue is not None
    assert cue.method == name


@pytest.mark.parametrize("name", CUES)
def test_every_method_survives_a_scene_without_evidence(name: str) -> None:
    reconstruction, _ = cameras_only(Room(photos=1))
    assert METHODS[name](reconstruction) is None
    assert read_cue(name, reconstruction) is None


@pytest.mark.parametrize("module", [plane_ransac, normal_clustering])
def test_geometric_baselines_take_a_wall_for_the_floor(module: object) -> None:
    room = Room(floor=False, table=False, boxes=0, walls=1, pitch_deg=0, orbit_deg=60)
    reconstruction, down = make_room(room)
    evidence = module.estimate(reconstruction)
    assert angle_between_deg(evidence.down_world, down) == pytest.approx(90, abs=3)


def test_manhattan_baseline_needs_upright_photos() -> None:
    reconstruction, down = make_room(Room(roll_deg=90, seed=3))
    evidence = manhattan_frame.estimate(reconstruction)
    assert evidence is not None
    assert angle_between_deg(evidence.down_world, down) > 45


def test_vanishing_point_of_a_bundle() -> None:
    rng = np.random.default_rng(0)
    centre = np.array([300.0, -150.0])
    start = rng.uniform(0, 200, (40, 2))
    end = start + (centre - start) * rng.uniform(0.1, 0.2, (40, 1))
    wild = rng.uniform(0, 200, (15, 4))
    point = manhattan_frame.vanishing_point(np.vstack([np.hstack([start, end]), wild]), 0)
    assert point is not None
    np.testing.assert_allclose(point[:2] / point[2], centre, atol=1e-6)


def test_unknown_method_is_named() -> None:
    reconstruction, _ = cameras_only(Room())
    with pytest.raises(BadInput, match="there are planes"):
        read_cue("compass", reconstruction)
