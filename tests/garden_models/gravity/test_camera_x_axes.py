"""The photographer's habit: level, rolled and mixed photos, and how sure it may be."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.geometry.direction import axis_angle_deg
from garden_models.geometry.rotation import angle_between_deg
from garden_models.gravity import camera_x_axes
from garden_models.gravity.camera_x_axes import ROLL_BIAS, ROLL_SPREAD, shared_bias_form
from tests.garden_models.gravity.synthetic_room import Room, cameras_only


@pytest.mark.parametrize("seed", range(6))
def test_level_orbit_gives_gravity(seed: int) -> None:
    reconstruction, down = cameras_only(Room(seed=seed))
    evidence = camera_x_axes.estimate(reconstruction)
    assert evidence is not None
    error = angle_between_deg(evidence.down_world, down)
    assert error < 3
    assert error < 2 * evidence.sigma_deg
    assert "level" in evidence.note


@pytest.mark.parametrize("roll", [90.0, -90.0])
def test_rolled_orbit_is_read_as_rolled(roll: float) -> None:
    reconstruction, down = cameras_only(Room(roll_deg=roll, orbit_deg=200))
    cue = camera_x_axes.read(reconstruction)
    assert cue is not None
    best = max(cue.modes, key=lambda mode: mode.probability)
    assert "rolled" in best.note
    assert axis_angle_deg(best.axis, down) < 3


def test_mixed_landscape_and_portrait() -> None:
    reconstruction, down = cameras_only(Room(portrait_share=0.4, orbit_deg=200))
    cue = camera_x_axes.read(reconstruction)
    assert cue is not None
    assert min(axis_angle_deg(mode.axis, down) for mode in cue.modes) < 3


def test_uncertainty_grows_when_all_photos_look_one_way() -> None:
    wide, _ = cameras_only(Room(orbit_deg=180))
    narrow, _ = cameras_only(Room(orbit_deg=8))
    sure, unsure = camera_x_axes.estimate(wide), camera_x_axes.estimate(narrow)
    assert sure is not None
    assert unsure is not None
    assert sure.sigma_deg < 5
    assert unsure.sigma_deg > 3 * sure.sigma_deg


def test_careless_photos_are_less_sure() -> None:
    sigmas = np.array(
        [
            [
                camera_x_axes.estimate(cameras_only(room)[0]).sigma_deg
                for room in (Room(seed=seed), Room(seed=seed, roll_spread_deg=10))
            ]
            for seed in range(8)
        ]
    )
    assert sigmas[:, 1].mean() > 1.3 * sigmas[:, 0].mean()


def test_sigma_is_calibrated_over_captures() -> None:
    ratios = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        room = Room(
            seed=seed,
            roll_deg=rng.normal(0, np.degrees(ROLL_BIAS)),
            roll_spread_deg=np.degrees(ROLL_SPREAD),
            orbit_deg=rng.uniform(15, 200),
        )
        reconstruction, down = cameras_only(room)
        evidence = camera_x_axes.estimate(reconstruction)
        ratios.append(angle_between_deg(evidence.down_world, down) / evidence.sigma_deg)
    # Photos are drawn independent here while the cue takes them to be correlated: below 1.
    assert 0.3 < np.sqrt(np.mean(np.square(ratios))) < 1.2


def test_more_photos_do_not_make_it_exact() -> None:
    few, _ = cameras_only(Room(photos=10))
    many, _ = cameras_only(Room(photos=100))
    sigmas = [camera_x_axes.estimate(r).sigma_deg for r in (few, many)]
    assert sigmas[1] > 0.8 * sigmas[0]


def test_form_is_the_inverse_covariance_of_the_residuals() -> None:
    axes = np.random.default_rng(0).normal(size=(4, 3))
    covariance = 0.1**2 * np.eye(4) + 0.2**2 * np.ones((4, 4))
    expected = axes.T @ np.linalg.inv(covariance) @ axes
    np.testing.assert_allclose(shared_bias_form(axes, 0.1, 0.2), expected)


def test_one_camera_says_nothing() -> None:
    reconstruction, _ = cameras_only(Room(photos=1))
    assert camera_x_axes.estimate(reconstruction) is None


def test_up_is_not_taken_for_down() -> None:
    reconstruction, down = cameras_only(Room(pitch_deg=-30))
    evidence = camera_x_axes.estimate(reconstruction)
    assert evidence is not None
    assert evidence.down_world @ down > 0
