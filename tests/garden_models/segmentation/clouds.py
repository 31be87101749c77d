"""Point clouds of plain shapes in GV (y down), evenly sampled."""

from __future__ import annotations

import numpy as np

from garden_models.geometry.rotation import axis_angle
from garden_models.scene import PointCloud

GREY = (128, 128, 128)
RED = (200, 40, 40)
BLUE = (40, 60, 200)


def cloud(xyz, normal=(0.0, -1.0, 0.0), rgb=GREY, spacing=0.01):
    """Points with the same normal, colour and spacing, or each its own."""
    n = len(xyz)
    return PointCloud(
        np.asarray(xyz, float),
        np.broadcast_to(np.asarray(rgb, np.uint8), (n, 3)).copy(),
        np.broadcast_to(np.asarray(normal, float), (n, 3)).copy(),
        np.broadcast_to(np.asarray(spacing, float), (n,)).copy(),
        np.ones(n),
    )


def sheet(centre, u, v, normal, rgb=GREY, spacing=0.01):
    """A rectangle spanned by half edges ``u`` and ``v``."""
    steps = [
        np.linspace(-1, 1, max(round(2 * np.linalg.norm(half) / spacing), 1)) for half in (u, v)
    ]
    a, b = (grid.reshape(-1, 1) for grid in np.meshgrid(*steps))
    return cloud(np.array(centre) + a * np.array(u) + b * np.array(v), normal, rgb, spacing)


def joined(*clouds):
    return PointCloud(
        *(
            np.concatenate([getattr(one, name) for one in clouds])
            for name in ("xyz", "rgb", "normal", "spacing", "confidence")
        )
    )


def level(half, y=0.0, centre=(0.0, 0.0), rgb=GREY, spacing=0.01):
    """A level square that faces up."""
    return sheet((centre[0], y, centre[1]), (half, 0, 0), (0, 0, half), (0, -1, 0), rgb, spacing)


def block(half, bottom=0.0, centre=(0.0, 0.0), rgb=RED, spacing=0.01):
    """Top and sides of an upright box that stands at height ``bottom``."""
    (hx, hy, hz), (x, z), y = half, centre, bottom - half[1]
    return joined(
        sheet((x, y - hy, z), (hx, 0, 0), (0, 0, hz), (0, -1, 0), rgb, spacing),
        sheet((x + hx, y, z), (0, hy, 0), (0, 0, hz), (1, 0, 0), rgb, spacing),
        sheet((x - hx, y, z), (0, hy, 0), (0, 0, hz), (-1, 0, 0), rgb, spacing),
        sheet((x, y, z + hz), (hx, 0, 0), (0, hy, 0), (0, 0, 1), rgb, spacing),
        sheet((x, y, z - hz), (hx, 0, 0), (0, hy, 0), (0, 0, -1), rgb, spacing),
    )


def moved(points, scale=2.0, yaw=0.7, shift=(3.0, -1.0, 2.0)):
    """The cloud turned about gravity, enlarged and shifted."""
    turn = axis_angle(np.array([0.0, 1.0, 0.0]), yaw)
    return PointCloud(
        scale * points.xyz @ turn.T + np.array(shift),
        points.rgb,
        points.normal @ turn.T,
        scale * points.spacing,
        points.confidence,
    )
