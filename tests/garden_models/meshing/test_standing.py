from __future__ import annotations

import numpy as np
import pytest

from garden_models.meshing.standing import CONTACT_BANDS, stand_on, tipping_angle_deg
from garden_models.meshing.surface import extract_surface
from garden_models.meshing.voxels import VoxelGrid

GRID = VoxelGrid(np.zeros(3), 0.01, (30, 43, 30))
SUPPORT = 0.01 * 39.5
"""Half a voxel under layer 39; layers 40 to 42 lie below it."""


def _column(foot_layers: int, foot_width: int) -> np.ndarray:
    """A 20 x 20 column whose lowest ``foot_layers`` are only ``foot_width`` wide."""
    field = np.ones(GRID.shape)
    field[5:25, 4:40, 5:25] = -1.0
    field[:, 40 - foot_layers : 40] = 1.0
    field[5 : 5 + foot_width, 40 - foot_layers : 40, 5:25] = -1.0
    return field


def test_a_solid_foot_needs_no_more_than_the_contact_band() -> None:
    stood, share = stand_on(_column(0, 20), GRID, SUPPORT, 0.03)
    assert share == CONTACT_BANDS[0]
    surface = extract_surface(stood, GRID.origin_gv, GRID.spacing)
    assert surface.vertices[:, 1].max() == pytest.approx(SUPPORT, abs=1e-6)


@pytest.mark.parametrize("layers", [2, 4, 7])
def test_a_foot_at_one_edge_is_carried_down_until_it_stands(layers: int) -> None:
    field = _column(layers, 3)
    assert tipping_angle_deg(field[:, :40]) < 0
    stood, share = stand_on(field, GRID, SUPPORT, 0.03)
    assert tipping_angle_deg(stood[:, :40]) > 20
    assert CONTACT_BANDS[0] < share <= 0.3 or layers <= 2
    np.testing.assert_array_equal(stood[:, :28] < 0, field[:, :28] < 0)


def test_what_cannot_be_made_to_stand_keeps_its_foot() -> None:
    field = _column(34, 3)
    _, share = stand_on(field, GRID, SUPPORT, 0.03)
    assert share == CONTACT_BANDS[0]


def test_tipping_angle_of_a_box() -> None:
    angle = tipping_angle_deg(_column(0, 20)[:, :40])
    assert angle == pytest.approx(np.degrees(np.arctan2(10, 18)), abs=1.0)
    assert tipping_angle_deg(np.ones((4, 4, 4))) == -90.0


def test_nothing_solid_stays_nothing() -> None:
    empty = np.ones(GRID.shape)
    stood, share = stand_on(empty, GRID, SUPPORT, 0.03)
    assert share == 0.0 and (stood > 0).all()
