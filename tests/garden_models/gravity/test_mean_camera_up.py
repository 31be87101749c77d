"""The mean camera's y axis as gravity."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from garden_models.geometry.rotation import angle_between_deg
from garden_models.gravity.mean_camera_up import estimate
from tests.garden_models.gravity.synthetic_room import Room, cameras_only


def test_level_cameras_give_it_up_to_their_pitch():
    reconstruction, down = cameras_only(Room(photos=12, orbit_deg=330.0, roll_spread_deg=0.0))
    found = estimate(reconstruction)
    assert angle_between_deg(found.down_world, down) < 6


def test_rolled_cameras_mislead_it():
    reconstruction, down = cameras_only(Room(photos=12, portrait_share=1.0))
    assert angle_between_deg(estimate(reconstruction).down_world, down) > 45


def test_without_cameras_it_says_nothing():
    reconstruction, _ = cameras_only(Room())
    assert estimate(dataclasses.replace(reconstruction, views=())) is None
    view = reconstruction.views[0]
    turned = view.camera_from_world.copy()
    turned[1:] *= -1  # the same camera upside down
    pair = (view, dataclasses.replace(view, camera_from_world=turned))
    assert estimate(dataclasses.replace(reconstruction, views=pair)) is None


def test_one_camera_is_enough():
    reconstruction, _ = cameras_only(Room())
    found = estimate(dataclasses.replace(reconstruction, views=reconstruction.views[:1]))
    assert found.down_world == pytest.approx(reconstruction.views[0].camera_from_world[1, :3])
    assert np.linalg.norm(found.down_world) == pytest.approx(1)
