"""Supports of the scene and of its objects become one set without duplicates."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.geometry.outline import inside_polygon
from garden_models.physics.merge_supports import merge_supports
from garden_models.scene import SupportSurface
from tests.garden_models.physics import room


def surface(name, kind, height, outline):
    return SupportSurface(name, kind, height, np.asarray(outline, float), 1.0, 100)


FLOOR = surface("floor", "floor", 1.2, [[-2, 0], [2, 0], [2, 4], [-2, 4]])
TABLE = surface("table_1", "table", 0.5, room.TABLE_OUTLINE)


def block(x, bottom, z, size=(0.2, 0.2, 0.2)):
    corners = np.array([[i, j, k] for i in (-0.5, 0.5) for j in (-1, 0) for k in (-0.5, 0.5)])
    return corners * size + [x, bottom, z]


def test_own_support_at_the_table_is_the_table():
    own = surface("patch_1", "patch", 0.507, [[-0.1, 1.8], [0.1, 1.8], [0.1, 2.0], [-0.1, 2.0]])
    supports, carriers = merge_supports((FLOOR, TABLE), (own,), ["a"], [block(0, 0.5, 1.9)])
    assert carriers == ["table_1"]
    assert [s.name for s in supports] == ["floor", "table_1"]
    assert supports[1].height_gv == pytest.approx(0.507)


def test_two_on_one_table_share_the_mean_height():
    own = [surface("patch", "patch", y, room.TABLE_OUTLINE) for y in (0.496, 0.504)]
    placed = [block(0, 0.5, 1.9), block(0.3, 0.5, 1.9)]
    supports, carriers = merge_supports((FLOOR, TABLE), tuple(own), ["a", "b"], placed)
    assert carriers == ["table_1", "table_1"]
    assert supports[1].height_gv == pytest.approx(0.5)


def test_the_table_grows_under_what_stands_on_its_edge():
    own = surface("patch", "patch", 0.5, room.TABLE_OUTLINE)
    placed = block(0.5, 0.5, 1.9)
    supports, _ = merge_supports((FLOOR, TABLE), (own,), ["a"], [placed])
    assert inside_polygon(placed[:, [0, 2]] * [0.999, 1] + [0, 0], supports[1].outline_gv).all()


def test_a_surface_of_its_own_is_added():
    own = surface("patch_1", "patch", 0.8, [[-0.2, 1.8], [0.2, 1.8], [0.2, 2.2], [-0.2, 2.2]])
    supports, carriers = merge_supports((FLOOR, TABLE), (own,), ["a"], [block(0, 0.8, 1.9)])
    assert carriers == ["patch_1"]
    assert len(supports) == 3
    again, carriers = merge_supports((FLOOR, own), (own,), ["patch_1"], [block(0, 0.8, 1.9)])
    assert carriers == ["support_patch_1"]
    assert len({s.name for s in again} | {"patch_1"}) == 3


def test_no_support_stays_none():
    assert merge_supports((FLOOR,), (None,), ["a"], [block(0, 0.5, 1.9)])[1] == [""]
