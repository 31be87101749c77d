"""Splats: no holes near, no bleeding far, nearest wins, colours blend."""

from __future__ import annotations

import time

import numpy as np
import pytest

from garden_models.rendering.config import Splatting
from garden_models.rendering.splat import splat_points
from garden_models.scene import PointCloud

SIZE = (160, 120)
K = np.array([[140.0, 0, 80.0], [0, 140.0, 60.0], [0, 0, 1]])


def cloud(xyz, rgb, spacing):
    n = len(xyz)
    rgb = np.broadcast_to(np.asarray(rgb, np.uint8), (n, 3)).copy()
    return PointCloud(xyz, rgb, np.zeros((n, 3)), np.full(n, float(spacing)), np.ones(n))


def wall(z, spacing, rgb, half=2.0, seed=0):
    steps = np.arange(-half, half, spacing)
    x, y = np.meshgrid(steps, steps)
    jitter = np.random.default_rng(seed).uniform(-0.3, 0.3, (2, x.size)) * spacing
    return cloud(
        np.stack([x.ravel() + jitter[0], y.ravel() + jitter[1], np.full(x.size, z)], 1),
        rgb,
        spacing,
    )


def joined(*clouds):
    return PointCloud(
        *(
            np.concatenate([getattr(c, f) for c in clouds])
            for f in ("xyz", "rgb", "normal", "spacing", "confidence")
        )
    )


@pytest.mark.parametrize("spacing", [0.005, 0.02, 0.1])
def test_a_surface_has_no_holes_at_any_spacing(spacing):
    raster = splat_points(wall(1.5, spacing, (200, 50, 50)), np.eye(4), K, SIZE)
    assert (raster.depth > 0).all()
    np.testing.assert_allclose(raster.depth, 1.5, rtol=1e-5)
    np.testing.assert_allclose(raster.rgb, np.broadcast_to([200, 50, 50], raster.rgb.shape))


def test_the_near_wall_hides_the_far_one():
    near, far = wall(1.0, 0.03, (255, 0, 0), half=0.2), wall(3.0, 0.03, (0, 0, 255), half=4)
    raster = splat_points(joined(far, near), np.eye(4), K, SIZE)
    middle = raster.rgb[40:80, 60:100]
    np.testing.assert_allclose(middle, np.broadcast_to([255, 0, 0], middle.shape), atol=0.01)
    # Beyond the near wall's edge (0.2 m at 140 px per m, plus a disc) it does not bleed.
    assert (raster.rgb[:, :46, 0] == 0).all()


def test_points_of_one_surface_blend_and_others_do_not():
    pair = np.array([[0.0, 0, 1.0], [0.0, 0, 1.005]])
    behind = np.array([[0.0, 0, 1.5]])
    points = joined(
        cloud(pair[:1], (200, 0, 0), 0.02),
        cloud(pair[1:], (0, 200, 0), 0.02),
        cloud(behind, (0, 0, 200), 0.02),
    )
    red, green, blue = splat_points(points, np.eye(4), K, SIZE).rgb[60, 80]
    assert red == pytest.approx(100, abs=2)
    assert green == pytest.approx(100, abs=2)
    assert blue == 0


def test_a_far_point_is_still_a_pixel():
    raster = splat_points(cloud(np.array([[0.1, 0.2, 50.0]]), 9, 0.001), np.eye(4), K, SIZE)
    assert 1 <= (raster.depth > 0).sum() <= 2


def test_pinholes_close_and_large_gaps_stay():
    points = wall(1.0, 0.01, (200, 0, 0), half=1.0)
    far = wall(3.0, 0.05, (0, 0, 200), half=4)
    away = np.hypot(points.xyz[:, 0], points.xyz[:, 1])
    pinhole = joined(points.subset(away > 0.013), far)
    assert (splat_points(pinhole, np.eye(4), K, SIZE).rgb[..., 2] == 0).all()
    gap = joined(points.subset(away > 0.1), far)
    assert (splat_points(gap, np.eye(4), K, SIZE).rgb[..., 2] > 0).sum() > 200


def test_nothing_in_view_is_an_empty_picture():
    behind = splat_points(cloud(np.array([[0.0, 0, -1]]), 9, 0.1), np.eye(4), K, SIZE)
    assert (behind.depth == 0).all()
    none = splat_points(cloud(np.zeros((0, 3)), 9, 0.1), np.eye(4), K, SIZE)
    assert (none.rgb == 0).all()


def test_wrong_settings_are_refused():
    with pytest.raises(ValueError, match="radius"):
        Splatting(radius=0)


def test_half_a_million_points_take_about_a_second():
    rng = np.random.default_rng(0)
    xyz = rng.uniform([-2, -1.5, 1.5], [2, 1.5, 4], (500_000, 3))
    points = cloud(xyz, 100, 0.01)
    big = np.diag([4.0, 4.0, 1.0]) @ K
    start = time.process_time()
    splat_points(points, np.eye(4), big, (640, 480))
    assert time.process_time() - start < 4  # about 0.9 s; the slack is for a busy machine
