"""A prediction becomes cameras and a reconstruction; what is not true does not end well."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from garden_models.geometry.camera import backproject_depth
from garden_models.reconstruction import da3_photos
from garden_models.reconstruction.depth_anything_3 import predict
from garden_models.reconstruction.fuse_prediction import fuse_prediction
from garden_models.reconstruction.fuse_prediction_config import FusePrediction
from garden_models.reconstruction.geometry_model import GeometryPrediction
from garden_models.reconstruction.memory_need import MemoryNeed
from garden_models.reconstruction.photo_geometry import predict_geometry, request_of
from garden_models.reconstruction.photo_geometry_config import PhotoGeometry
from garden_models.reconstruction.predicted_cameras import predicted_cameras
from garden_models.scene import BadGeometry, BadInput, Capture, KnownCamera, Photo
from tests.doubles import depth_anything_3 as double
from tests.doubles.depth_anything_3 import da3_double
from tests.doubles.true_views import TrueViews, box_room

pytest.importorskip("depth_anything_3")
COUNT = 8


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setattr(da3_photos, "LONG_SIDE", 224)
    monkeypatch.setattr(double, "LONG_SIDE", 224)


@pytest.fixture(scope="module")
def truth() -> TrueViews:
    return box_room(COUNT, size=(168, 126), focal=135.0)


def capture_of(truth: TrueViews, cameras: bool = False) -> Capture:
    photos = tuple(
        Photo(f"{i}.jpg", rgb, (rgb.shape[1] * 4, rgb.shape[0] * 4))
        for i, rgb in enumerate(truth.photos)
    )
    known = tuple(
        KnownCamera(f"{i}.jpg", truth.K[i], truth.camera_from_world[i]) for i in range(len(truth))
    )
    return Capture(photos, known if cameras else ())


def predicted(truth: TrueViews, capture: Capture, network, **options) -> GeometryPrediction:
    return predict_geometry(
        capture,
        lambda request: predict(network, request),
        lambda _request: MemoryNeed(1.0, 0.1),
        PhotoGeometry("depth_anything_3", **options),
    )


def distance_to_box(points: np.ndarray) -> np.ndarray:
    """How far points are from the walls and the ball of ``box_room``."""
    half = np.array([3.0, 1.5, 2.5])
    walls = np.abs(half - np.abs(points)).min(axis=1)
    ball = np.abs(np.linalg.norm(points - [0.3, 0.7, 0.2], axis=1) - 0.5)
    return np.minimum(walls, ball)


@pytest.mark.parametrize("known", [False, True])
def test_a_true_prediction_becomes_a_true_reconstruction(truth, known):
    capture = capture_of(truth, known)
    prediction = predicted(truth, capture, da3_double(truth))
    cameras = predicted_cameras(capture, prediction)
    assert cameras.verdict.status == "ok" and len(cameras.points_world) > 500
    assert cameras.scale.source == ("known_cameras" if known else "metric_depth")
    assert cameras.cameras_source == ("known" if known else "estimated")
    np.testing.assert_allclose(cameras.cameras[3].K, truth.K[3], atol=0.05)
    assert cameras.cameras[3].size == (168, 126)
    found = fuse_prediction(capture, cameras, prediction)
    assert found.verdict.status == "ok" and found.scale == cameras.scale
    kept = np.mean([(view.depth > 0).mean() for view in found.views])
    assert kept > 0.7 and len(found.points_world) > 10_000
    view = found.views[3]
    assert view.size == (224, 168) and view.original_size == (672, 504) and view.photo == "3.jpg"
    # The world is that of the given cameras, or the reference view's: undo it.
    move = np.eye(4)
    if not known:
        first = np.vstack([found.views[0].camera_from_world, [0, 0, 0, 1]])
        true = np.vstack([truth.camera_from_world[0], [0, 0, 0, 1]])
        move = np.linalg.inv(true) @ first
    points = found.points_world.xyz @ move[:3, :3].T + move[:3, 3]
    assert np.quantile(distance_to_box(points), 0.95) < 0.02
    lifted = backproject_depth(view.depth, view.K, view.camera_from_world)[view.depth > 0]
    assert np.quantile(distance_to_box(lifted @ move[:3, :3].T + move[:3, 3]), 0.9) < 0.02


def test_without_metres_a_scale_is_assumed_and_told(truth):
    capture = capture_of(truth)
    prediction = predicted(truth, capture, da3_double(truth, nested=False))
    cameras = predicted_cameras(capture, prediction)
    assert cameras.scale.source == "unknown" and "assumed" in cameras.scale.note
    found = fuse_prediction(capture, cameras, prediction)
    depths = np.concatenate([view.depth[view.depth > 0] for view in found.views])
    assert np.median(depths) == pytest.approx(1.5, rel=0.1)
    ratio = found.views[2].depth.max() / prediction.views[2].depth.max()
    assert ratio == pytest.approx(cameras.scale.metres_per_unit, rel=0.05)


def test_photos_without_a_given_camera_are_left_out(truth):
    capture = capture_of(truth, cameras=True)
    capture = replace(capture, cameras=capture.cameras[:-2])
    prediction = predicted(truth, capture, da3_double(truth))
    cameras = predicted_cameras(capture, prediction)
    assert len(cameras.cameras) == COUNT - 2 and cameras.unregistered == ("6.jpg", "7.jpg")
    assert fuse_prediction(capture, cameras, prediction).unregistered == ("6.jpg", "7.jpg")


def test_the_model_is_asked_about_undistorted_photos(truth):
    capture = capture_of(truth, cameras=True)
    bent = replace(capture.cameras[0], distortion=np.array([-0.2, 0.05, 0, 0]))
    capture = replace(capture, cameras=(bent, *capture.cameras[1:]))
    request = request_of(capture)
    assert not np.array_equal(request.photos[0], truth.photos[0])
    np.testing.assert_array_equal(request.photos[1], truth.photos[1])
    prediction = predicted(truth, capture, da3_double(truth))
    cameras = predicted_cameras(capture, prediction)
    np.testing.assert_array_equal(cameras.cameras[0].distortion, bent.distortion)
    view = fuse_prediction(capture, cameras, prediction).views[0]
    np.testing.assert_array_equal(view.distortion, bent.distortion)


def outcome(capture: Capture, prediction: GeometryPrediction) -> str:
    cameras = predicted_cameras(capture, prediction)
    if cameras.verdict.status == "failed":
        return "failed"
    try:
        return fuse_prediction(capture, cameras, prediction).verdict.status
    except BadGeometry:
        return "failed"


def test_transposed_cameras_do_not_end_well(truth):
    capture = capture_of(truth)
    prediction = predicted(truth, capture, da3_double(truth, transposed=True))
    assert outcome(capture, prediction) != "ok"


def test_depth_of_another_scale_than_the_cameras_does_not_end_well(truth):
    capture = capture_of(truth)
    prediction = predicted(truth, capture, da3_double(truth))
    wrong = replace(
        prediction, views=tuple(replace(v, depth=v.depth * 1.5) for v in prediction.views)
    )
    assert outcome(capture, prediction) == "ok" and outcome(capture, wrong) != "ok"


def test_gaussians_of_another_scale_than_the_depth_do_not_end_well(truth, monkeypatch):
    from garden_models.reconstruction import depth_anything_3

    capture = capture_of(truth)
    prediction = predicted(truth, capture, da3_double(truth), gaussians=True)
    assert prediction.gaussians is not None and prediction.verdict.status == "ok"
    read = depth_anything_3.read_gaussians
    monkeypatch.setattr(
        depth_anything_3, "read_gaussians", lambda found, _factor, keep: read(found, 1.0, keep)
    )
    wrong = predicted(truth, capture, da3_double(truth, unit=2.5), gaussians=True)
    assert wrong.verdict.status == "degraded"
    assert "lie at 0.39" in wrong.verdict.reasons[0]


def test_depths_that_disagree_are_dropped(truth):
    capture = capture_of(truth)
    prediction = predicted(truth, capture, da3_double(truth))
    spoilt = prediction.views[4].depth.copy()
    spoilt[40:90, 40:130] *= 1.3
    views = list(prediction.views)
    views[4] = replace(views[4], depth=spoilt)
    wrong = replace(prediction, views=tuple(views))
    found = fuse_prediction(capture, predicted_cameras(capture, wrong), wrong, FusePrediction())
    assert (found.views[4].depth[45:85, 45:125] > 0).mean() < 0.1
    assert (found.views[4].depth[100:] > 0).mean() > 0.6


def test_cameras_of_another_prediction_are_refused(truth):
    capture = capture_of(truth)
    prediction = predicted(truth, capture, da3_double(truth))
    cameras = predicted_cameras(capture, prediction)
    fewer = replace(prediction, views=prediction.views[:-1])
    with pytest.raises(BadInput, match="predict again"):
        predicted_cameras(capture, fewer)
    with pytest.raises(BadInput, match="predict again"):
        fuse_prediction(capture, cameras, fewer)


def test_one_photo_is_too_few(truth):
    capture = replace(capture_of(truth), photos=capture_of(truth).photos[:1])
    with pytest.raises(BadInput, match="two photos or more"):
        predicted(truth, capture, da3_double(truth))
