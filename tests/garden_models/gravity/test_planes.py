"""Planes: supports, walls, slanted things; which side is up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from garden_models.geometry.direction import axis_angle_deg
from garden_models.geometry.rotation import angle_between_deg
from garden_models.gravity import planes
from tests.garden_models.gravity.synthetic_room import Room, make_room


@pytest.mark.parametrize("seed", range(3))
def test_table_and_floor_give_gravity(seed: int) -> None:
    reconstruction, down = make_room(Room(seed=seed))
    evidence = planes.estimate(reconstruction)
    assert evidence is not None
    assert angle_between_deg(evidence.down_world, down) < 0.3


def test_slanted_boards_do_not_turn_the_table() -> None:
    reconstruction, down = make_room(Room(seed=2, slanted=5, walls=0))
    evidence = planes.estimate(reconstruction)
    assert evidence is not None
    assert angle_between_deg(evidence.down_world, down) < 0.5


def test_two_walls_alone_cross_in_the_vertical() -> None:
    room = Room(floor=False, table=False, boxes=0, pitch_deg=0)
    reconstruction, down = make_room(room)
    cue = planes.read(reconstruction)
    assert cue is not None
    upright = [mode for mode in cue.modes if mode.note.startswith("0 horizontal")]
    assert upright
    assert min(axis_angle_deg(mode.axis, down) for mode in upright) < 0.5


def test_one_wall_leaves_its_own_plane_open() -> None:
    room = Room(floor=False, table=False, boxes=0, walls=1, pitch_deg=0, orbit_deg=60)
    reconstruction, down = make_room(room)
    cue = planes.read(reconstruction)
    assert cue is not None
    walls = [mode for mode in cue.modes if mode.note.startswith("one wall")]
    assert walls
    assert walls[0].sigma_deg > 45
    assert down @ walls[0].form @ down < 4  # within two sigma of the wall's own plane


def test_the_laden_side_is_up() -> None:
    reconstruction, down = make_room(Room())
    cue = planes.read(reconstruction)
    assert cue is not None
    assert cue.down_log_odds(down) > 2
    assert cue.down_log_odds(-down) == pytest.approx(-cue.down_log_odds(down))


def test_a_bare_ceiling_says_little() -> None:
    room = Room(ceiling=True, floor=False, table=False, boxes=0, pitch_deg=-20)
    reconstruction, down = make_room(room)
    cue = planes.read(reconstruction)
    assert cue is not None
    assert abs(cue.down_log_odds(down)) < 3


def test_the_unit_of_length_does_not_matter() -> None:
    reconstruction, _ = make_room(Room(seed=1))
    cloud = reconstruction.points_world
    grown = replace(
        reconstruction,
        points_world=replace(cloud, xyz=cloud.xyz * 64, spacing=cloud.spacing * 64),
        views=tuple(
            replace(
                v,
                camera_from_world=np.hstack(
                    [v.camera_from_world[:, :3], 64 * v.camera_from_world[:, 3:]]
                ),
            )
            for v in reconstruction.views
        ),
    )
    one, other = planes.estimate(reconstruction), planes.estimate(grown)
    assert one is not None
    assert other is not None
    assert angle_between_deg(one.down_world, other.down_world) < 1e-6
    assert one.sigma_deg == pytest.approx(other.sigma_deg)


def test_no_points_no_evidence() -> None:
    reconstruction, _ = make_room(Room())
    empty = reconstruction.points_world.subset(np.zeros(0, dtype=int))
    assert planes.estimate(replace(reconstruction, points_world=empty)) is None
