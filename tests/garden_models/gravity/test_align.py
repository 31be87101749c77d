"""The whole alignment on synthetic rooms: every roll, clutter, few cues, calibration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from garden_models.geometry.gravity_view import gv_from_world
from garden_models.geometry.rotation import angle_between_deg
from garden_models.gravity.align import align_gravity
from garden_models.gravity.config import AlignGravity
from garden_models.scene import BadGeometry, BadInput
from tests.garden_models.gravity.synthetic_room import Room, cameras_only, make_room

CORRIDOR = Room(
    corridor=True, floor=False, table=False, boxes=0, walls=0, pitch_deg=12, roll_spread_deg=1
)
ROOMS = {
    "plain": Room(),
    "slanted clutter": Room(slanted=5),
    "rolled by a quarter turn": Room(roll_deg=90),
    "rolled the other way": Room(roll_deg=-90),
    "rolled, nothing but a table": Room(roll_deg=90, floor=False, walls=0),
    "upside down": Room(roll_deg=180),
    "landscape and portrait": Room(portrait_share=0.4),
    "crooked camera": Room(roll_deg=7),
    "all look one way": Room(orbit_deg=15),
    "straight down": Room(pitch_deg=70, walls=0),
    "one wall only": Room(floor=False, table=False, boxes=0, walls=1, pitch_deg=0, orbit_deg=60),
    "corridor, walls alone": CORRIDOR,
    "floor and ceiling": Room(ceiling=True, pitch_deg=0),
}


@pytest.mark.parametrize("name", ROOMS)
def test_gravity_is_found(name: str) -> None:
    reconstruction, down = make_room(replace(ROOMS[name], seed=7))
    view = align_gravity(reconstruction)
    assert angle_between_deg(view.down_world, down) < 0.7
    assert view.sigma_deg < 3
    reference = next(v for v in reconstruction.views if v.photo == view.reference_photo)
    np.testing.assert_array_equal(
        view.gv_from_world, gv_from_world(view.down_world, reference.camera_from_world)
    )
    np.testing.assert_allclose(view.gv_from_world[:3, :3] @ view.down_world, [0, 1, 0], atol=1e-12)


def test_progress_is_told_and_bits_repeat() -> None:
    reconstruction, _ = make_room(Room(photos=6))
    told: list[float] = []
    first = align_gravity(reconstruction, progress=lambda share, _: told.append(share))
    assert told == sorted(told)
    assert told[-1] == 1.0
    np.testing.assert_array_equal(first.down_world, align_gravity(reconstruction).down_world)


def test_cameras_alone_are_degraded_with_the_reason() -> None:
    reconstruction, down = cameras_only(Room())
    view = align_gravity(reconstruction)
    assert angle_between_deg(view.down_world, down) < 5
    assert view.verdict.status == "degraded"
    assert any("camera_x_axes" in reason for reason in view.verdict.reasons)


def test_loose_clutter_is_never_surer_than_it_is() -> None:
    room = Room(floor=False, table=False, walls=0, boxes=0, slanted=9)
    for seed in range(2):
        reconstruction, down = make_room(replace(room, seed=seed))
        view = align_gravity(reconstruction)
        assert angle_between_deg(view.down_world, down) < 2.5 * view.sigma_deg


@pytest.mark.slow
def test_sigma_is_calibrated_on_crooked_rooms() -> None:
    ratios = []
    for seed in range(12):
        room = Room(
            seed=seed, crooked_deg=0.9, roll_deg=2 * np.sin(seed), slanted=seed % 4, walls=seed % 3
        )
        reconstruction, down = make_room(room)
        view = align_gravity(reconstruction)
        ratios.append(angle_between_deg(view.down_world, down) / view.sigma_deg)
    assert 0.25 < np.sqrt(np.mean(np.square(ratios))) < 1.3
    assert max(ratios) < 3


def test_no_view_and_wrong_settings_are_refused() -> None:
    reconstruction, _ = cameras_only(Room(photos=1))
    with pytest.raises(BadGeometry, match="no view"):
        align_gravity(replace(reconstruction, views=()))
    with pytest.raises(BadGeometry, match="nothing tells"):
        align_gravity(reconstruction)
    with pytest.raises(BadInput, match="at least one method"):
        AlignGravity(methods=())
    with pytest.raises(BadInput, match="max_disagreement_deg is 0"):
        AlignGravity(max_disagreement_deg=0)
    with pytest.raises(BadInput, match="no gravity method is called 'tea_leaves'"):
        align_gravity(reconstruction, AlignGravity(methods=("tea_leaves",)))
