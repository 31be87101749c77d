from __future__ import annotations

import numpy as np
import pytest

from garden_models.geometry.rotation import axis_angle, rotation_angle_deg, yaw_gv
from garden_models.geometry.upright import nearest_yaw, tilt_deg


@pytest.mark.parametrize("yaw", [-3.0, -1.0, 0.0, 0.4, 2.9])
def test_an_upright_rotation_is_its_own_nearest(yaw: float) -> None:
    assert nearest_yaw(yaw_gv(yaw)) == pytest.approx(yaw)
    assert tilt_deg(yaw_gv(yaw)) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_no_other_turn_about_gravity_is_nearer(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rotation = yaw_gv(rng.uniform(-3, 3)) @ axis_angle(rng.normal(size=3), rng.uniform(0, 0.8))
    yaw = nearest_yaw(rotation)
    found = rotation_angle_deg(yaw_gv(yaw).T @ rotation)
    others = [rotation_angle_deg(yaw_gv(yaw + d).T @ rotation) for d in np.linspace(0.01, 6.2, 60)]
    assert found <= min(others)


def test_the_lean_is_the_angle_of_the_y_axis() -> None:
    for axis in ([1.0, 0.0, 0.0], [0.3, 0.0, -0.9]):
        rotation = yaw_gv(1.3) @ axis_angle(np.array(axis), np.radians(17.0))
        assert tilt_deg(rotation) == pytest.approx(17.0)
