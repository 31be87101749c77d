from __future__ import annotations

import numpy as np
import pytest

from garden_models.geometry.rotation import axis_angle, rotation_angle_deg, yaw_gv
from garden_models.geometry.upright import tilt_deg
from garden_models.placement.upright_hypotheses import distinct, made_upright, upright_rotations

GV_FROM_CAMERA = yaw_gv(0.3) @ axis_angle(np.array([1.0, 0.2, 0.1]), -0.6)


def poses(rotations: np.ndarray) -> np.ndarray:
    out = np.tile(np.eye(4), (len(rotations), 1, 1))
    out[:, :3, :3] = rotations
    out[:, :3, 3] = np.random.default_rng(0).normal(size=(len(rotations), 3))
    return out


def test_all_hypotheses_are_upright_and_go_all_around() -> None:
    rotations = upright_rotations(GV_FROM_CAMERA)
    assert len(rotations) == 36
    in_gv = GV_FROM_CAMERA @ rotations
    assert max(tilt_deg(one) for one in in_gv) < 1e-6
    steps = [rotation_angle_deg(a.T @ b) for a, b in zip(in_gv, np.roll(in_gv, 1, 0), strict=True)]
    np.testing.assert_allclose(steps, 10.0, atol=1e-6)


def test_projecting_back_undoes_a_small_lean_and_keeps_the_place() -> None:
    upright = poses(upright_rotations(GV_FROM_CAMERA))
    lean = axis_angle(np.array([0.9, 0.0, 0.4]), np.radians(8.0))
    leaning = upright.copy()
    leaning[:, :3, :3] = GV_FROM_CAMERA.T @ lean @ GV_FROM_CAMERA @ upright[:, :3, :3]
    back = made_upright(leaning, GV_FROM_CAMERA)
    np.testing.assert_array_equal(back[:, :3, 3], upright[:, :3, 3])
    turned = [
        rotation_angle_deg(a[:3, :3].T @ b[:3, :3]) for a, b in zip(back, upright, strict=True)
    ]
    assert max(turned) < 0.5
    assert max(tilt_deg(GV_FROM_CAMERA @ one[:3, :3]) for one in back) < 1e-6


def test_with_the_camera_transposed_they_would_lean() -> None:
    wrong = upright_rotations(GV_FROM_CAMERA.T)
    assert max(tilt_deg(GV_FROM_CAMERA @ one) for one in wrong) > 20


@pytest.mark.parametrize("keep", [1, 2, 5])
def test_poses_that_are_the_same_but_for_noise_count_once(keep: int) -> None:
    one = poses(np.stack([yaw_gv(0.0), yaw_gv(0.05), yaw_gv(1.0), yaw_gv(2.0)]))
    one[:, :3, 3] = [0, 0, 1]
    assert distinct(one, 0.2, keep) == [0, 2, 3][:keep]
    one[1, :3, 3] = [0, 0, 1.05]
    assert distinct(one, 0.2, keep) == [0, 1, 2, 3][:keep]
