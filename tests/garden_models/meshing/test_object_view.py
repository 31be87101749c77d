from __future__ import annotations

import dataclasses

import numpy as np
import trimesh

from garden_models.meshing.object_view import depth_noise, object_views, signed_outline_distance
from tests.garden_models.meshing.staged import Staged, orbit, stage, standing


def _staged(noise: float = 0.0, holes: float = 0.0) -> Staged:
    box = standing(trimesh.creation.box([0.16, 0.16, 0.16]))
    return stage([box], orbit(6, 360, 30, 0.6), noise=noise, holes=holes)


def test_outline_distance_counts_pixels_from_the_outline() -> None:
    mask = np.zeros((9, 9), bool)
    mask[:, 4:] = True
    distance = signed_outline_distance(mask)
    np.testing.assert_allclose(distance[4], [3.5, 2.5, 1.5, 0.5, -0.5, -1.5, -2.5, -3.5, -4.5])
    assert signed_outline_distance(np.ones((4, 4), bool)).max() < -4


def test_views_without_the_object_are_left_out() -> None:
    staged = _staged()
    masks = list(staged.masks.masks)
    masks[2] = np.zeros_like(masks[2])
    views = object_views(
        staged.reconstruction,
        staged.gravity_view,
        dataclasses.replace(staged.masks, masks=tuple(masks)),
    )
    assert [view.index for view in views] == [0, 1, 3, 4, 5]


def test_print_on_the_object_that_the_mask_left_out_is_filled_a_window_is_not() -> None:
    staged = _staged()
    masks = list(staged.masks.masks)
    rows, columns = np.nonzero(masks[0])
    row, column = int(rows.mean()), int(columns.mean())
    masks[0] = masks[0].copy()
    masks[0][row - 4 : row + 4, column - 4 : column + 4] = False
    damaged = dataclasses.replace(staged.masks, masks=tuple(masks))
    views = object_views(staged.reconstruction, staged.gravity_view, damaged)
    assert views[0].mask[row, column]
    view = staged.reconstruction.views[0]
    depth = view.depth.copy()
    depth[row - 4 : row + 4, column - 4 : column + 4] += 0.3
    far = dataclasses.replace(view, depth=depth)
    reconstruction = dataclasses.replace(
        staged.reconstruction, views=(far, *staged.reconstruction.views[1:])
    )
    views = object_views(reconstruction, staged.gravity_view, damaged)
    assert not views[0].mask[row, column]


def test_pixels_proved_to_show_the_object_are_unknown() -> None:
    staged = _staged()
    masks = list(staged.masks.masks)
    rows, _ = np.nonzero(masks[1])
    cut = masks[1].copy()
    cut[: int(np.median(rows))] = False
    lost = masks[1] & ~cut
    masks[1] = cut
    views = object_views(
        staged.reconstruction,
        staged.gravity_view,
        dataclasses.replace(staged.masks, masks=tuple(masks)),
    )
    assert views[1].unknown[lost].mean() > 0.7
    assert not views[0].unknown.any()


def test_depth_noise_is_measured() -> None:
    for noise in (0.002, 0.006):
        staged = _staged(noise=noise)
        views = object_views(staged.reconstruction, staged.gravity_view, staged.masks)
        found = depth_noise(views, staged.masks.points_gv.xyz.astype(float))
        # Points and depths carry the same noise; hidden points add to it.
        assert 0.3 * noise < found < 5 * noise * 0.6


def test_cosine_is_high_where_a_face_looks_at_the_camera() -> None:
    staged = _staged()
    views = object_views(staged.reconstruction, staged.gravity_view, staged.masks)
    inner = views[0].outside_px < -4
    assert views[0].cosine[inner].max() > 0.6
    assert (views[0].cosine >= 0.15).all() and (views[0].cosine <= 1.0).all()
