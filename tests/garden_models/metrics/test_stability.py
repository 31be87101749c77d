"""Stability is read off motions."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.metrics.stability import stability
from garden_models.scene import Body, BodyMotion, Scale, SimScene, Trajectory


def body(name, carrier="table"):
    corner = np.array([[0.0, 0, 0], [0.2, 0, 0], [0, -0.1, 0], [0, 0, 0.1]])
    rgb = np.zeros((4, 3), np.uint8)
    return Body(name, corner, np.zeros((0, 3), int), rgb, (), 1.0, np.zeros(3), np.eye(3), 0.5,
                np.eye(4), 0.0, carrier)  # fmt: skip


def trajectory(*motions):
    count = len(motions)
    return Trajectory(np.zeros(1), np.zeros((1, count, 3)), np.zeros((1, count, 4)), motions)


def test_counts_the_stable():
    scene = SimScene((body("a"), body("b"), body("c", "")), (), Scale("known_cameras"))
    motions = (
        BodyMotion("a", 1.0, 0.001, 0.0004, True),
        BodyMotion("b", 0.5, 0.010, 0.0002, True),
        BodyMotion("c", 0.0, 0.0, 0.0, True),
    )
    got = stability(scene, trajectory(*motions))
    assert got.bodies == 3
    assert got.stable_share == pytest.approx(1 / 3)
    assert got.worst_tilt_deg == 1.0
    assert got.worst_relative_drift == pytest.approx(0.05)
    assert got.worst_penetration_m == 0.0004


def test_other_bodies_are_refused():
    scene = SimScene((body("a"),), (), Scale("known_cameras"))
    with pytest.raises(ValueError, match="other bodies"):
        stability(scene, trajectory(BodyMotion("b", 0, 0, 0, True)))
    with pytest.raises(ValueError, match="no bodies"):
        stability(SimScene((), (), Scale("known_cameras")), trajectory())
