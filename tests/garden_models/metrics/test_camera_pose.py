"""Camera errors: blind to the frame and scale of the world, right on known errors."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.geometry.rigid import invert_rigid, rigid
from garden_models.geometry.rotation import axis_angle
from garden_models.metrics.camera_pose import camera_pose_errors


def random_poses(seed: int, count: int = 8) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.stack(
        [
            rigid(axis_angle(rng.normal(size=3), rng.uniform(0, 3)), rng.normal(size=3))[:3]
            for _ in range(count)
        ]
    )


def in_another_world(poses: np.ndarray, scale: float, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    other_from_world = rigid(axis_angle(rng.normal(size=3), 2.0), rng.normal(size=3))
    moved = []
    for pose in poses:
        camera_from_other = pose @ invert_rigid(other_from_world)
        moved.append(np.hstack([camera_from_other[:, :3], scale * camera_from_other[:, 3:]]))
    # The centres scale about the new world's origin, as the points of that world do.
    return np.stack(moved)


@pytest.mark.parametrize("seed", range(5))
def test_the_same_cameras_in_another_world_have_no_error(seed: int) -> None:
    true = random_poses(seed)
    errors = camera_pose_errors(in_another_world(true, 3.7, seed + 100), true)
    assert errors.rotation_deg.max() < 1e-5
    assert errors.position.max() < 1e-9
    assert errors.pair_rotation_deg.max() < 1e-5
    assert np.nanmax(errors.pair_direction_deg) < 1e-5


def test_one_turned_camera_shows() -> None:
    true = random_poses(1, 20)
    wrong = true.copy()
    wrong[3] = axis_angle(np.array([0.0, 0, 1]), np.radians(2.0)) @ true[3]
    errors = camera_pose_errors(wrong, true)
    assert errors.rotation_deg[3] == pytest.approx(2.0, abs=0.15)
    assert np.delete(errors.rotation_deg, 3).max() < 0.15
    assert errors.pair_rotation_deg.max() == pytest.approx(2.0, abs=1e-6)


def test_one_misplaced_camera_shows() -> None:
    true = random_poses(2, 30)
    wrong = true.copy()
    wrong[0, :, 3] += [0.05, 0, 0]
    errors = camera_pose_errors(wrong, true)
    assert int(np.argmax(errors.position)) == 0
    assert errors.rotation_deg.max() < 1e-5


def test_too_few_cameras_are_refused() -> None:
    poses = random_poses(3, 2)
    with pytest.raises(ValueError, match="3 or more"):
        camera_pose_errors(poses, poses)
