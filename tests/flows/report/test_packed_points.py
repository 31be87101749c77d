"""Packed points can be read back where they were, group by group."""

from __future__ import annotations

import numpy as np

from flows.report.packed_points import Group, cube_around, pack_points, thinned
from tests.garden_models.rendering.test_splat import cloud


def unpacked(data: bytes) -> tuple[np.ndarray, np.ndarray]:
    """Return places in the cube (-1..1) and colours, as the viewer's shader reads them."""
    rows = np.frombuffer(data, np.uint8).reshape(-1, 9).astype(float)
    return (rows[:, 3:6] * 256 + rows[:, :3]) / 65535 * 2 - 1, rows[:, 6:]


def test_groups_are_read_back() -> None:
    rng = np.random.default_rng(0)
    room, mug = rng.uniform(-2, 2, (4000, 3)), rng.uniform(0.1, 0.2, (500, 3))
    room[0] = 500.0  # a stray point neither counts for the cube nor sticks to its wall
    groups = [
        Group("background", cloud(room, (10, 20, 30), 0.05)),
        Group("objects", cloud(mug, (200, 0, 0), 0.002)),
    ]
    cube = cube_around(groups)
    assert cube.half < 2.2
    packed, listed = pack_points(groups, cube)
    places, colours = unpacked(packed)
    assert [(g["name"], g["start"]) for g in listed] == [
        ("background", 0),
        ("objects", listed[0]["count"]),
    ]
    assert listed[0]["count"] < 4000
    assert len(places) == listed[0]["count"] + 500
    np.testing.assert_allclose(places[-500:], cube.to_unit(mug), atol=2e-5)
    assert (colours[-500:] == [200, 0, 0]).all()
    assert listed[1]["spacing"] < listed[0]["spacing"] / 10


def test_thinned_points_are_drawn_larger() -> None:
    points = cloud(np.zeros((1000, 3)), 9, 0.1)
    few = thinned(points, 250)
    assert len(few) == 250
    np.testing.assert_allclose(few.spacing, 0.2)
    assert thinned(points, 1000) is points
