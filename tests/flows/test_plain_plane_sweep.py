"""The peer of the depth benchmark measures depth itself: it is no straw man."""

from __future__ import annotations

import numpy as np

from flows.benchmark.plain_plane_sweep import plain_plane_sweep
from garden_models.reconstruction.stereo_plan import StereoPlan
from garden_models.reconstruction.undistort import WorkingView

K = np.array([[120.0, 0, 60], [0, 120.0, 45], [0, 0, 1]])


def wall(depth: float, offset: float) -> WorkingView:
    """A camera ``offset`` metres to the right before a textured wall."""
    x, y = np.meshgrid(np.arange(120) + 0.5, np.arange(90) + 0.5)
    along, down = (x - 60) / 120 * depth + offset, (y - 45) / 120 * depth
    shade = sum(
        np.sin(f * along + p) * np.cos(f * down - p)
        for f, p in [(23, 0.3), (41, 1.1), (67, 2.0), (95, 0.7)]
    )
    rgb = np.repeat((128 + 30 * shade).astype(np.uint8)[..., None], 3, 2)
    camera_from_world = np.column_stack([np.eye(3), [-offset, 0, 0]])
    return WorkingView(f"{offset}.jpg", rgb, K, camera_from_world, (120, 90), np.zeros(4))


def test_it_finds_a_textured_wall() -> None:
    views = tuple(wall(2.0, offset) for offset in (0.0, 0.15, 0.3))
    partners = {0: (1, 2), 1: (0, 2), 2: (0, 1)}
    plan = StereoPlan(views, partners, dict.fromkeys(range(3), (1 / 4.0, 1 / 1.0)))
    depth = plain_plane_sweep(plan)[1]
    assert (depth > 0).mean() > 0.7
    assert np.median(np.abs(depth[depth > 0] / 2.0 - 1)) < 0.005
