from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from garden_models.geometry.camera import project
from garden_models.meshing.best_view import best_view, flying_pixels, mesh_request, point_map
from garden_models.scene import BadGeometry
from tests.garden_models.meshing.staged import block, orbit, stage, standing


@pytest.fixture(scope="module")
def staged():
    cameras = [orbit(1, 0, 30, radius)[0] for radius in (1.4, 0.7, 1.0)]
    return stage([standing(block())], cameras)


def test_the_largest_mask_is_best(staged) -> None:
    assert best_view(staged.reconstruction, staged.masks) == 1


def test_what_is_half_hidden_there_is_better_seen_elsewhere(staged) -> None:
    masks = dataclasses.replace(staged.masks, occluded=np.array([0.0, 0.5, 0.0]))
    assert best_view(staged.reconstruction, masks) == 2


def test_a_mask_without_depth_is_of_no_use(staged) -> None:
    views = list(staged.reconstruction.views)
    views[1] = dataclasses.replace(views[1], depth=np.zeros_like(views[1].depth))
    assert best_view(dataclasses.replace(staged.reconstruction, views=tuple(views)), staged.masks)
    none = tuple(dataclasses.replace(v, depth=np.zeros_like(v.depth)) for v in views)
    with pytest.raises(BadGeometry, match="'thing'"):
        best_view(dataclasses.replace(staged.reconstruction, views=none), staged.masks)


def test_every_point_projects_into_its_own_pixel(staged) -> None:
    view = staged.reconstruction.views[1]
    points = point_map(view)
    row, column = np.nonzero(np.isfinite(points).all(-1))
    pixels, z = project(points[row, column].astype(float), view.K, np.eye(4))
    np.testing.assert_allclose(pixels, np.stack([column, row], 1) + 0.5, atol=1e-3)
    np.testing.assert_allclose(z, view.depth[row, column], rtol=1e-5)


def test_pixels_between_surfaces_fly() -> None:
    depth = np.full((9, 9), 1.0)
    depth[:, 5:] = 2.0
    depth[0, 0] = 0.0
    flying = flying_pixels(depth)
    assert flying[:, 4:6].all() and not flying[:, :3].any() and not flying[:, 7:].any()
    assert not flying_pixels(np.full((5, 5), 3.0)).any()


def test_no_point_at_the_outline_hangs_between_object_and_table(staged) -> None:
    """Stereo blends depth there; such points must not reach the model."""
    view, mask = staged.reconstruction.views[1], staged.masks.masks[1]
    blended = view.depth.copy()
    edge = mask & ~np.roll(mask, 1, axis=1)
    blended[edge] = 1.5 * blended[edge]
    request = mesh_request(dataclasses.replace(view, depth=blended), mask, 7)
    assert np.isnan(request.points_camera[edge & (blended > 0)]).all()
    assert np.isfinite(request.points_camera[mask]).all(-1).mean() > 0.5
    assert request.seed == 7
