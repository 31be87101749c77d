from __future__ import annotations

import numpy as np
import pytest

from garden_models.meshing.extent import largest_gap_deg, rest_height, within_seen
from garden_models.meshing.object_view import object_views
from garden_models.meshing.voxels import VoxelGrid
from tests.garden_models.meshing.staged import block, orbit, stage, standing


@pytest.mark.parametrize(("arc", "count", "gap"), [(360, 12, 30.0), (90, 7, 270.0)])
def test_the_gap_in_a_ring_of_cameras(arc: float, count: int, gap: float) -> None:
    staged = stage([standing(block())], orbit(count, arc, 30, 0.7))
    views = object_views(staged.reconstruction, staged.gravity_view, staged.masks)
    assert largest_gap_deg(views, np.zeros(3)) == pytest.approx(gap, abs=1e-6)


def test_rest_height_is_the_support_unless_many_points_lie_below() -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform([-0.1, -0.2, -0.1], [0.1, 0.0, 0.1], (4000, 3))
    assert rest_height(points, 0.0) == 0.0
    stray = points.copy()
    stray[:20, 1] = 0.1
    assert rest_height(stray, 0.0) == 0.0
    assert rest_height(points, -0.05) == pytest.approx(0.0, abs=0.01)


def test_within_seen_holds_the_points_and_their_foot() -> None:
    rng = np.random.default_rng(0)
    top = rng.uniform([-1, -1, -1], [1, -0.8, 1], (500, 3))
    places = np.array([[0, -0.9, 0], [0, -0.1, 0], [0, -0.9, 1.5], [0, -1.5, 0]], np.float32)
    np.testing.assert_array_equal(within_seen(places, top, 0.0, 0.01), [True, True, False, False])
    assert not within_seen(places, top, None, 0.01)[1]


def test_voxels_know_their_places() -> None:
    grid = VoxelGrid.around(np.array([0.0, 1.0, 2.0]), np.array([1.0, 2.0, 4.0]), 0.25)
    assert grid.shape == (5, 5, 9)
    np.testing.assert_allclose(grid.high_gv, [1.0, 2.0, 4.0])
    flat = np.arange(int(np.prod(grid.shape)))
    back, inside = grid.nearest(grid.centres(flat).astype(float))
    np.testing.assert_array_equal(back, flat)
    assert inside.all()
    assert not grid.nearest(np.array([[-1.0, 1.0, 2.0]]))[1][0]
