"""Which surface of the room an object stands on."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.geometry.outline import inside_polygon, signed_area
from garden_models.physics.support_surfaces import SurfacePlane
from garden_models.segmentation.carrier import Carrier
from garden_models.segmentation.support import support_of
from tests.garden_models.segmentation.clouds import joined, level

CAMERAS = np.array([[0.0, -1.0, -1.0]])
ROOM = joined(level(1.5, y=0.8, spacing=0.03), level(0.4, y=0.0, spacing=0.015))


def carrier(height, nodes, foot=(0.1, -0.05), slope=(0.0, 0.0), band=0.01):
    n = len(nodes)
    return Carrier(
        SurfacePlane(height, np.array(slope)),
        band,
        nodes.xyz[:, 1] - height,
        np.ones(n, bool),
        np.zeros(n, bool),
        np.array(foot),
        1.0,
    )


def support_at(height, nodes=level(0.1), **carried):
    return support_of("cup", carrier(height, nodes, **carried), nodes, ROOM, CAMERAS)


def test_what_stands_at_the_tables_height_stands_on_the_table():
    support = support_at(0.004)
    assert support.kind == "table"
    assert support.area_m2 == pytest.approx(0.64, rel=0.15)


def test_its_height_is_that_at_the_foot():
    assert support_at(0.004).height_gv == 0.004
    leaning = support_at(0.0, foot=(0.1, -0.1), slope=(0.05, 0.02))
    assert leaning.height_gv == pytest.approx(0.003)


def test_what_stands_at_the_floors_height_stands_on_the_floor():
    assert support_at(0.8, foot=(1.0, 1.0)).kind == "floor"


@pytest.mark.parametrize(
    ("height", "foot"), [(-0.2, (0.1, -0.05)), (0.0, (1.0, 1.0)), (0.3, (0.0, 0.0))]
)
def test_where_the_room_has_no_surface_it_is_a_patch_under_the_foot(height, foot):
    nodes = level(0.1, y=height, centre=foot)
    support = support_at(height, nodes, foot=foot)
    assert (support.kind, support.name) == ("patch", "under_cup")
    assert support.height_gv == height
    assert inside_polygon(np.array([foot]), support.outline_gv)[0]
    assert support.area_m2 == pytest.approx(0.04, rel=0.8)
    assert support.area_m2 == pytest.approx(abs(signed_area(support.outline_gv)))
    assert support.inliers == len(nodes)
