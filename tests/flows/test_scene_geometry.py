"""A model's geometry as steps of a scene: stored, read of, cached, chunked, refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from flows.preset import Preset, with_settings
from flows.scene_geometry import (
    background_gaussians,
    by_model,
    fused_prediction,
    predicted_gravity,
    prediction_and_cameras,
)
from garden_models import foundation
from garden_models.geometry.camera import backproject_depth
from garden_models.gravity.decoder.checkpoint import to_bytes
from garden_models.gravity.decoder.config import DecoderConfig
from garden_models.gravity.decoder.network import GravityViewDecoder
from garden_models.reconstruction import da3_photos
from garden_models.reconstruction.geometry_model import Gaussians, GeometryPrediction
from garden_models.scene import Capture, GravityView, Reconstruction, SparseModel
from storage import Store
from tasks.model.resident import residents
from tasks.step import RunContext, StepFailed, load, run_context
from tests.doubles import depth_anything_3 as double
from tests.doubles.true_geometry import put_truth
from tests.doubles.true_views import TrueViews, box_room
from tests.garden_models.reconstruction.test_fuse_prediction import capture_of

pytest.importorskip("depth_anything_3")
COUNT = 8
METHOD = "depth_anything_3"


@pytest.fixture(scope="module")
def truth() -> TrueViews:
    return box_room(COUNT, size=(168, 126), focal=135.0)


@pytest.fixture
def weights(tmp_path: Path, truth: TrueViews, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(da3_photos, "LONG_SIDE", 168)
    monkeypatch.setattr(double, "LONG_SIDE", 168)
    monkeypatch.setitem(foundation.ADAPTERS, METHOD, "tests.doubles.true_geometry")
    monkeypatch.setenv("GARDEN_WEIGHTS", str(tmp_path / "weights"))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("GARDEN_MODELS", raising=False)
    residents.free()
    put_truth(tmp_path / "weights" / METHOD, truth)
    yield tmp_path / "weights" / METHOD
    residents.free()


@pytest.fixture
def context(tmp_path: Path) -> RunContext:
    store = Store.open(tmp_path / "store", durability="none")
    return RunContext(store=store, scene="room", engine="local", isolate=False)


def preset_of(**options: object) -> Preset:
    return with_settings(Preset(), {"geometry": {"method": METHOD} | options})


def test_the_embedded_geometry_is_the_default():
    assert not by_model(Preset()) and by_model(preset_of())


def test_photos_become_an_upright_reconstruction(truth, weights, context):
    capture, preset = capture_of(truth), preset_of(gaussians=True, camera_tokens=True)
    with run_context(context):
        prediction, cameras = prediction_and_cameras(capture, preset)
        reconstruction = fused_prediction(capture, cameras, prediction, preset)
        gravity = predicted_gravity(reconstruction, prediction, preset)
        splats = background_gaussians(reconstruction, gravity, prediction, (), preset)
        again, _ = prediction_and_cameras(capture, preset)
        stored = load(prediction, GeometryPrediction)
        found = load(reconstruction, Reconstruction)
        gv = load(gravity, GravityView)
        assert load(cameras, SparseModel).scale.source == "metric_depth"
        assert splats is not None
        background = load(splats, Gaussians)
    assert again.outcome == "cached" and prediction.outcome == "executed"
    assert prediction.backend == METHOD
    assert len(stored.views) == COUNT and stored.gaussians is not None and stored.camera_tokens
    assert found.verdict.status == "ok" and found.scale.source == "metric_depth"
    true_down = truth.camera_from_world[0][:, :3] @ [0.0, 1.0, 0.0]
    down = found.views[0].camera_from_world[:, :3] @ gv.down_world
    assert np.degrees(np.arccos(np.clip(down @ true_down, -1, 1))) < 1.0
    assert len(background.mean) == len(stored.gaussians.mean)
    heights = np.quantile(background.mean[:, 1], [0.01, 0.5, 0.99])
    true = [
        backproject_depth(d, truth.K[0], camera)[..., 1]
        for d, camera in zip(truth.depth, truth.camera_from_world, strict=True)
    ]
    np.testing.assert_allclose(
        np.diff(heights), np.diff(np.quantile(true, [0.01, 0.5, 0.99])), atol=0.03
    )


def test_a_decoder_of_camera_tokens_is_one_more_cue(truth, weights, context, tmp_path):
    decoder = DecoderConfig(
        token_width=double.WIDTH, tokens="da3nested-giant-large", width=8, blocks=1, heads=2,
        feature=8, head=8,
    )  # fmt: skip
    torch.manual_seed(0)
    path = tmp_path / "decoder.safetensors"
    path.write_bytes(to_bytes(GravityViewDecoder(decoder), None, None, {}))
    preset = with_settings(preset_of(camera_tokens=True), {"token_gravity": {"weights": str(path)}})
    with run_context(context):
        prediction, cameras = prediction_and_cameras(capture_of(truth), preset)
        reconstruction = fused_prediction(capture_of(truth), cameras, prediction, preset)
        gravity = load(predicted_gravity(reconstruction, prediction, preset), GravityView)
        without, _ = prediction_and_cameras(capture_of(truth), preset_of())
        with pytest.raises(StepFailed, match="holds no camera tokens"):
            predicted_gravity(reconstruction, without, preset)
    methods = [evidence.method for evidence in gravity.evidence]
    assert methods[0] == "camera_tokens" and "planes" in methods
    assert not gravity.evidence[0].accepted  # it never learned anything: the others hold


def test_hundreds_of_photos_are_chunked_by_the_stated_memory(truth, weights, context):
    capture = capture_of(truth)
    preset = preset_of(gpu_memory_gb=1.8, overlap=3)
    with run_context(context):
        prediction, cameras = prediction_and_cameras(capture, preset)
        assert cameras.status == "ok" and len(load(prediction, GeometryPrediction).views) == COUNT
        with pytest.raises(StepFailed, match="state more"):
            prediction_and_cameras(capture, preset_of(gpu_memory_gb=1.2))


@pytest.mark.parametrize("broken", ["transposed", "unscaled"])
def test_a_broken_convention_does_not_end_ok(truth, weights, context, broken):
    put_truth(weights, truth, **{broken: True})
    capture, preset = capture_of(truth), preset_of(gaussians=True)
    with run_context(context):
        prediction, cameras = prediction_and_cameras(capture, preset)
        if broken == "unscaled":
            assert prediction.status == "degraded"
            assert "times the predicted depth" in prediction.reasons[0]
        elif not cameras.failed:
            try:
                assert fused_prediction(capture, cameras, prediction, preset).status != "ok"
            except StepFailed as failure:
                assert failure.kind == "BadGeometry"


def test_other_weights_are_another_prediction(truth, weights, context):
    capture, preset = capture_of(truth), preset_of()
    with run_context(context):
        prediction_and_cameras(capture, preset)
        put_truth(weights, truth, unit=7.0)
        again, _ = prediction_and_cameras(capture, preset)
    assert again.outcome == "executed"


def test_what_cannot_be_is_refused_in_a_sentence(truth, weights, context):
    capture = capture_of(truth)
    with run_context(context):
        for options, message in (
            ({"method": "sam3"}, "does not predict geometry"),
            ({"method": "nerf"}, "no model is called 'nerf'"),
        ):
            with pytest.raises(StepFailed, match=message):
                prediction_and_cameras(capture, preset_of(**options))
        (weights / "truth.npz").unlink()
        with pytest.raises(StepFailed, match=r"put them at .*truth\.npz"):
            prediction_and_cameras(capture, preset_of())


def test_photos_without_overlap_fail_with_what_to_do(truth, weights, context):
    apart = replace(
        truth,
        depth=tuple(
            d * f for d, f in zip(truth.depth, (1, 3, 0.3, 6, 0.1, 2, 0.5, 9), strict=True)
        ),
    )
    put_truth(weights, apart)
    with run_context(context):
        _, cameras = prediction_and_cameras(capture_of(truth), preset_of())
    assert cameras.failed and "overlap by more than half" in cameras.reasons[0]


def test_a_capture_of_one_photo_is_refused(truth, weights, context):
    capture = Capture(capture_of(truth).photos[:1])
    with run_context(context), pytest.raises(StepFailed, match="two photos or more"):
        prediction_and_cameras(capture, preset_of())
