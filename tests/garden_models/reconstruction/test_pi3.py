"""Pi3's conventions: world_from_camera, confidence logits, no intrinsics; Pi3X in metres."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.geometry.camera import pixel_grid, pixel_rays
from garden_models.reconstruction import pi3
from garden_models.reconstruction.intrinsics_from_points import intrinsics_from_points
from garden_models.scene import BadInput
from tests.doubles import pi3 as double
from tests.doubles.true_views import box_room
from tests.garden_models.reconstruction.against_truth import assert_true


@pytest.fixture(scope="module")
def truth():
    return box_room(3)


@pytest.mark.parametrize("metric", [True, False])
def test_a_rig_goes_through_its_conventions_and_comes_back(truth, metric, tmp_path, monkeypatch):
    double.install_pi3(truth, tmp_path, monkeypatch, metric)
    found = pi3.load(tmp_path, "cpu")(truth.request())
    assert found.metric == metric
    assert_true(found, truth, scale=1.0 if metric else 3.0)
    assert found.views[0].confidence.max() == pytest.approx(1 / (1 + np.exp(-2.0)))


@pytest.mark.parametrize("metric", [True, False])
def test_with_given_cameras_it_answers_in_their_world(truth, metric, tmp_path, monkeypatch):
    double.install_pi3(truth, tmp_path, monkeypatch, metric)
    found = pi3.load(tmp_path, "cpu")(truth.with_cameras())
    assert_true(found, truth, scale=1.0, same_world=True)


def test_poses_taken_for_camera_from_world_are_no_true_rig(truth, tmp_path, monkeypatch):
    double.install_pi3(truth, tmp_path, monkeypatch, True)
    monkeypatch.setattr(pi3, "invert_rigid", lambda matrix: matrix)
    found = pi3.load(tmp_path, "cpu")(truth.request())
    with pytest.raises(AssertionError):
        assert_true(found, truth)


def test_intrinsics_are_fitted_through_noise_and_wild_points():
    rng = np.random.default_rng(0)
    K = np.array([[310.0, 0, 140], [0, 305.0, 105], [0, 0, 1]])
    depth = rng.uniform(1, 4, (210, 280))
    points = pixel_rays(pixel_grid(210, 280), K) * depth[..., None]
    points[..., :2] += rng.normal(size=(210, 280, 2)) * 0.01
    wild = rng.random((210, 280)) < 0.2
    points[wild] = rng.normal((0, 0, 3), 1, (int(wild.sum()), 3))
    found = intrinsics_from_points(points, np.ones((210, 280)))
    np.testing.assert_allclose(found, K, rtol=0.01)
    with pytest.raises(ValueError, match="too few"):
        intrinsics_from_points(points, np.zeros((210, 280)))


def test_it_has_no_tokens(truth, tmp_path, monkeypatch):
    double.install_pi3(truth, tmp_path, monkeypatch, False)
    with pytest.raises(BadInput, match="use depth_anything_3"):
        pi3.load(tmp_path, "cpu")(truth.request(want_tokens=True))


def test_photos_are_read_at_about_255_000_pixels():
    assert pi3.target_size((4000, 3000)) == (574, 434)
    width, height = pi3.target_size((3000, 4000))
    assert (width, height) == (434, 574)
