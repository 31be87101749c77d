"""The hull holds the object, and little else, when enough views agree."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from garden_models.geometry.camera import pixel_grid, pixel_rays
from garden_models.geometry.rigid import invert_rigid
from garden_models.scene import View
from garden_models.segmentation.hull import carve
from tests.garden_models.segmentation.ray_scene import look_at

SIZE, RADIUS = (96, 96), 0.2
K = np.array([[120.0, 0, 48], [0, 120.0, 48], [0, 0, 1]])
LOW, HIGH = np.full(3, -0.3), np.full(3, 0.3)
AROUND = tuple(
    look_at((np.sin(a), h, -np.cos(a)), (0, 0, 0))
    for h in (-0.8, 0.1)
    for a in np.radians(np.arange(0, 360, 45))
)


def ball(camera, hidden_by=None):
    """A view of a ball at the origin, and its silhouette by the rays' distance from it."""
    rays = pixel_rays(pixel_grid(*SIZE[::-1]), K)
    centre = camera[:3, 3]
    along = (rays @ centre) / (rays**2).sum(-1)
    distance = np.linalg.norm(centre - rays * along[..., None], axis=-1)
    mask = distance < RADIUS
    depth = np.where(mask, np.linalg.norm(centre) - RADIUS, 0.0)
    if hidden_by is not None:
        depth[:] = hidden_by
    rgb = np.zeros((*mask.shape, 3), np.uint8)
    return View("a", rgb, depth, np.ones(mask.shape), K, camera[:3], SIZE), mask


def carved(cameras, changed=None, depth=None):
    """The hull, where some views have another target probability and depth than the ball's."""
    changed = changed or {}
    views, masks = zip(
        *(ball(c, depth if i in changed else None) for i, c in enumerate(cameras)), strict=True
    )
    targets = [changed.get(i, mask.astype(np.float32)) for i, mask in enumerate(masks)]
    whole = (slice(0, SIZE[1]), slice(0, SIZE[0]))
    windows = [None if target is None else whole for target in targets]
    return carve(LOW, HIGH, views, cameras, targets, windows), masks


@cache
def of_the_ball():
    """The hull by all views, and their masks."""
    return carved(AROUND)


def volume(hull):
    return len(hull.centres) * hull.cell**3


BALL = 4 / 3 * np.pi * RADIUS**3
NOTHING = np.zeros(SIZE[::-1], np.float32)


def test_the_hull_of_a_ball_seen_from_all_around_is_the_ball():
    hull, _ = of_the_ball()
    assert 0.95 * BALL < volume(hull) < 1.2 * BALL
    assert np.linalg.norm(hull.centres, axis=1).max() < 1.3 * RADIUS


def test_every_voxel_of_the_object_is_in_its_hull():
    hull, _ = of_the_ball()
    axis = np.arange(-0.3 + hull.cell / 2, 0.3, hull.cell)
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)
    inner = np.linalg.norm(grid, axis=1) < RADIUS - hull.cell
    filled = {tuple(v) for v in np.round((hull.centres + 0.3) / hull.cell - 0.5).astype(int)}
    assert {tuple(v) for v in np.round((grid[inner] + 0.3) / hull.cell - 0.5).astype(int)} <= filled


def test_more_views_never_add_to_the_hull():
    volumes = [volume(carved(AROUND[:n])[0]) for n in (1, 2, 4, 6)]
    assert volumes == sorted(volumes, reverse=True)
    assert volumes[0] > 1.5 * volumes[-1]


def test_the_silhouette_of_the_hull_is_the_mask_it_was_carved_from():
    hull, masks = of_the_ball()
    for camera, mask in zip(AROUND, masks, strict=True):
        seen = hull.silhouette(K, camera, slice(0, SIZE[1]), slice(0, SIZE[0]))
        assert (seen & mask).sum() / (seen | mask).sum() > 0.85
        assert (seen & mask).sum() > 0.99 * mask.sum()


def test_the_silhouette_in_a_window_is_cut_from_the_whole_one():
    hull, _ = of_the_ball()
    whole = hull.silhouette(K, AROUND[0], slice(0, 96), slice(0, 96))
    part = hull.silhouette(K, AROUND[0], slice(10, 90), slice(5, 60))
    np.testing.assert_array_equal(part[8:-8, 8:-8], whole[10:90, 5:60][8:-8, 8:-8])


def test_one_wrong_mask_of_many_does_not_carve_the_object_away():
    hull, _ = carved(AROUND, {0: NOTHING}, depth=0.0)
    assert volume(hull) > 0.95 * BALL


def test_a_view_that_something_nearer_hides_says_nothing():
    hidden = dict.fromkeys(range(4), NOTHING)
    hull, _ = carved(AROUND, hidden, depth=0.2)
    assert 0.95 * BALL < volume(hull) < 1.4 * BALL
    for seen_past in (0.0, 3.0):
        assert volume(carved(AROUND, hidden, seen_past)[0]) < 0.05 * BALL


@pytest.mark.parametrize("targets", [None, NOTHING])
def test_without_any_view_of_it_nothing_is_filled(targets):
    hull, _ = carved(AROUND[:4], dict.fromkeys(range(4), targets))
    assert len(hull.centres) == 0
    assert not hull.silhouette(K, AROUND[0], slice(0, 96), slice(0, 96)).any()


def test_a_camera_that_looks_away_sees_no_silhouette():
    hull, _ = of_the_ball()
    away = invert_rigid(AROUND[0])
    away[:3, 0] *= -1
    away[:3, 2] *= -1
    camera = invert_rigid(away)
    assert not hull.silhouette(K, camera, slice(0, 96), slice(0, 96)).any()
