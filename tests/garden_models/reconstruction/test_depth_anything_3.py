"""Depth-Anything-3: its real classes with random weights, and its conventions by a double."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import torch

from garden_models.geometry.rotation import matrix_from_quaternion
from garden_models.reconstruction import da3_photos, depth_anything_3
from garden_models.reconstruction.da3_camera_tokens import camera_tokens
from garden_models.reconstruction.da3_network import STRATEGY, load_network
from garden_models.reconstruction.geometry_model import GeometryRequest
from garden_models.scene import BadGeometry, BadInput
from tests.doubles.depth_anything_3 import da3_double
from tests.doubles.true_views import box_room
from tests.garden_models.reconstruction.against_truth import assert_true

pytest.importorskip("depth_anything_3")


def photos(count: int, size: tuple[int, int] = (80, 60)) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(0)
    return tuple(
        rng.integers(0, 255, (size[1], size[0], 3), dtype=np.uint8) // (k + 1) for k in range(count)
    )


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from depth_anything_3.cfg import create_object, load_config
    from depth_anything_3.registry import MODEL_REGISTRY
    from safetensors.torch import save_file

    torch.manual_seed(0)
    net = create_object(load_config(MODEL_REGISTRY["da3-small"]))
    folder = tmp_path_factory.mktemp("da3")
    state = {f"model.{name}": w.contiguous().clone() for name, w in net.state_dict().items()}
    save_file(state, folder / "model.safetensors")
    (folder / "config.json").write_text(json.dumps({"model_name": "da3-small"}))
    return folder


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(da3_photos, "LONG_SIDE", 112)


@pytest.mark.slow
def test_the_real_network_answers_as_its_own_code_does(weights, small):
    request = GeometryRequest(photos(4), want_tokens=True)
    found = depth_anything_3.load(weights, "cpu")(request)
    network = load_network(weights, "cpu")
    pictures, _ = da3_photos.prepare(request.photos)
    with torch.inference_mode():
        own = network.net(torch.from_numpy(pictures)[None], None, None, export_feat_layers=[])
    for i, view in enumerate(found.views):
        np.testing.assert_array_equal(view.depth, own["depth"][0, i].numpy())
        np.testing.assert_allclose(view.K, own["intrinsics"][0, i].numpy())
        np.testing.assert_allclose(
            view.camera_from_world, own["extrinsics"][0, i].numpy(), atol=1e-5
        )
        np.testing.assert_allclose(view.confidence, 1 - 1 / own["depth_conf"][0, i].numpy())
        assert view.depth.shape == (84, 112) and view.seen.all()
    assert not found.metric and found.camera_tokens[0].kind == "da3-small"


@pytest.mark.slow
def test_the_real_network_takes_cameras_and_answers_in_their_world(weights, small):
    truth = box_room(4)
    predict = depth_anything_3.load(weights, "cpu")
    found = predict(truth.with_cameras())
    for view, camera in zip(found.views, truth.camera_from_world, strict=True):
        np.testing.assert_allclose(view.camera_from_world, camera, atol=1e-12)
        np.testing.assert_allclose(view.K, truth.K[0], atol=1e-9)  # 112 x 84 is their own size
    free = predict(truth.request())
    assert not np.allclose(found.views[1].depth / free.views[1].depth, 1.0, atol=0.05)


@pytest.mark.slow
def test_tokens_are_what_the_camera_decoder_reads_and_the_reference_is_the_chosen_one(
    weights, small, monkeypatch
):
    import depth_anything_3.model.dinov2.vision_transformer as vision

    network = load_network(weights, "cpu")
    chosen: list[int] = []
    select = vision.select_reference_view

    def spy(*args, **kwargs):
        found = select(*args, **kwargs)
        chosen.append(int(found[0]))
        return found

    for count in (2, 3, 5):
        with monkeypatch.context() as patched:
            patched.setattr(vision, "select_reference_view", spy)
            found = depth_anything_3.predict(
                network, GeometryRequest(photos(count), want_tokens=True)
            )
        (tokens,) = found.camera_tokens
        assert tokens.tokens.shape == (count, 768)
        assert tokens.reference == (0 if count < 3 else chosen[0])
        chosen.clear()
    alone, reference = camera_tokens(network, photos(5))
    np.testing.assert_array_equal(alone, tokens.tokens)
    assert reference == tokens.reference
    read: list[torch.Tensor] = []
    network.net.cam_dec.register_forward_pre_hook(lambda _module, inputs: read.append(inputs[0]))
    with torch.inference_mode():
        network.net(
            torch.from_numpy(da3_photos.prepare(photos(5))[0])[None],
            None,
            None,
            export_feat_layers=[],
            infer_gs=False,
            use_ray_pose=False,
            ref_view_strategy=STRATEGY,
        )
    np.testing.assert_array_equal(read[0].reshape(5, 768).float().numpy(), tokens.tokens)


@pytest.mark.slow
def test_weights_that_do_not_fit_are_refused(weights, tmp_path):
    from safetensors.torch import load_file, save_file

    state = load_file(weights / "model.safetensors")
    state.pop(next(iter(state)))
    save_file(state, tmp_path / "model.safetensors")
    (tmp_path / "config.json").write_text('{"model_name": "da3-small"}')
    with pytest.raises(BadInput, match="do not fit da3-small"):
        depth_anything_3.load(tmp_path, "cpu")
    (tmp_path / "model.safetensors").write_bytes(b"no weights")
    with pytest.raises(BadInput, match="download it again"):
        depth_anything_3.load(tmp_path, "cpu")


def test_a_folder_without_a_known_model_name_is_refused(tmp_path):
    with pytest.raises(BadInput, match=r"no config\.json"):
        load_network(tmp_path, "cpu")
    (tmp_path / "config.json").write_text("{}")
    with pytest.raises(BadInput, match="model_name"):
        load_network(tmp_path, "cpu")
    (tmp_path / "config.json").write_text('{"model_name": "da3-huge"}')
    with pytest.raises(BadInput, match="no model called da3-huge"):
        load_network(tmp_path, "cpu")


def test_small_and_base_may_be_used_commercially():
    card = depth_anything_3.CARD
    assert card.terms_of("da3-base").commercial and card.terms_of("da3-small").commercial
    assert not card.terms_of("da3-large").commercial and not card.terms_of(None).commercial


@pytest.mark.parametrize("nested", [True, False])
def test_a_rig_goes_through_its_conventions_and_comes_back(nested):
    truth = box_room(4)
    network = da3_double(truth, nested, unit=2.5)
    found = depth_anything_3.predict(network, truth.request(want_tokens=True))
    assert found.metric == nested
    assert_true(found, truth, scale=1.0 if nested else 2.5)
    (tokens,) = found.camera_tokens
    reference = found.views[tokens.reference].camera_from_world
    np.testing.assert_allclose(reference, np.eye(4)[:3], atol=1e-6)


@pytest.mark.parametrize("nested", [True, False])
def test_with_given_cameras_it_answers_in_their_world(nested):
    truth = box_room(4)
    found = depth_anything_3.predict(da3_double(truth, nested), truth.with_cameras())
    assert_true(found, truth, scale=1.0, same_world=True)
    assert found.verdict.status == "ok"


def test_cameras_of_other_photos_are_doubted():
    truth = box_room(6)
    shuffled = truth.camera_from_world[[3, 0, 5, 2, 1, 4]]
    network = da3_double(truth)
    network.anyview._check_cameras = lambda *_: None
    request = truth.request(K=truth.K, camera_from_world=shuffled)
    found = depth_anything_3.predict(network, request)
    assert found.verdict.status == "degraded"
    assert "turn otherwise than predicted" in found.verdict.reasons[0]


def test_cameras_in_one_place_tell_no_size():
    truth = box_room(3)
    still = truth.camera_from_world.copy()
    still[:, :, 3] = 0
    request = truth.request(K=truth.K, camera_from_world=still)
    for nested in (False, True):
        network = da3_double(truth, nested)
        network.anyview._check_cameras = lambda *_: None
        if nested:
            assert depth_anything_3.predict(network, request).metric
        else:
            with pytest.raises(BadInput, match="cameras that stand apart"):
                depth_anything_3.predict(network, request)


@pytest.mark.parametrize("given", [False, True])
@pytest.mark.parametrize("nested", [False, True])
def test_gaussians_lie_where_the_depth_is(nested, given):
    truth = box_room(3)
    ask = truth.with_cameras if given else truth.request
    network = da3_double(truth, nested, unit=2.5)
    found = depth_anything_3.predict(network, ask(want_gaussians=True))
    cloud = found.gaussians
    assert cloud is not None and cloud.mean.shape == (3 * 378 * 504, 3)
    unit = assert_true(found, truth)
    np.testing.assert_allclose(cloud.scale[0] * unit, [0.02, 0.02, 0.004], rtol=1e-3)
    np.testing.assert_allclose(np.linalg.norm(cloud.rotation, axis=1), 1, rtol=1e-5)
    assert cloud.opacity.max() == pytest.approx(0.8)
    for i, view in enumerate(found.views):
        own = cloud.subset(cloud.view == i)
        rotation, shift = view.camera_from_world[:, :3], view.camera_from_world[:, 3]
        z = own.mean @ rotation[2] + shift[2]
        np.testing.assert_allclose(z, view.depth.reshape(-1), rtol=1e-3)
        turn = rotation @ matrix_from_quaternion(own.rotation[0].astype(float))
        np.testing.assert_allclose(turn, np.eye(3), atol=1e-4)  # the double's lie along cameras
        prepared = da3_photos.resized(truth.photos[i]).reshape(-1, 3) / 255
        np.testing.assert_allclose(own.rgb, prepared, atol=1e-3)


def test_gaussians_need_their_head():
    network = da3_double(box_room(2))
    network.anyview.gs_head = None
    with pytest.raises(BadInput, match="evo and e3nn"):
        depth_anything_3.predict(network, box_room(2).request(want_gaussians=True))


def test_of_photos_of_several_sizes_it_sees_the_middles():
    wide, tall = box_room(2, (112, 84)), box_room(2, (84, 112))
    request = GeometryRequest((wide.photos[0], tall.photos[1]))
    pictures, framings = da3_photos.prepare(request.photos)
    assert pictures.shape == (2, 3, 378, 378)
    assert framings[0].size == (504, 378) and framings[0].seen().sum() == 378 * 378
    assert framings[1].size == (378, 504) and not framings[1].seen()[0].any()
    for framing, K in zip(framings, (wide.K[0], tall.K[0]), strict=True):
        inner = framing.model_intrinsics(K)
        np.testing.assert_allclose(inner[:2, 2], [189, 189])  # still the middle
        np.testing.assert_allclose(
            framing.whole_intrinsics(inner)[:2, 2], np.array(framing.size) / 2
        )


def test_sky_has_no_depth():
    truth = box_room(3)
    network = da3_double(truth)
    whole = network.net.forward

    def with_sky(*args, **kwargs):
        out = whole(*args, **kwargs)
        out["depth_conf"][:, :, :50] = 1.0
        out["depth"][:, :, :50] = 200.0
        return out

    network.net.forward = with_sky
    found = depth_anything_3.predict(network, truth.request(want_gaussians=True))
    assert (found.views[0].depth[:50] == 0).all() and (found.views[0].depth[50:] > 0).all()
    assert found.gaussians is not None and len(found.gaussians.mean) == 3 * (378 - 50) * 504


def test_the_metric_network_needs_cameras_and_gives_metres():
    truth = box_room(2)

    class Metric(torch.nn.Module):
        def __init__(self):
            super().__init__()
            self.anything = torch.nn.Parameter(torch.zeros(1))
            self.cam_dec = self.gs_head = None

        def forward(self, x, extrinsics, intrinsics, **_options):
            assert extrinsics is None and intrinsics is None
            size = x.shape[-1], x.shape[-2]
            K = truth.model_intrinsics(0, size, size)
            depth = np.stack([truth.depth_at(i, K, size) for i in range(2)]) * 300 / K[0, 0]
            sky = torch.zeros(1, 2, *x.shape[-2:])
            sky[:, :, :20] = 1
            return {"depth": torch.from_numpy(depth)[None], "sky": sky}

    network = depth_anything_3.Da3Network(Metric(), "da3metric-large")
    with pytest.raises(BadInput, match="give known cameras"):
        depth_anything_3.predict(network, truth.request())
    found = depth_anything_3.predict(network, truth.with_cameras())
    assert found.metric and (found.views[0].depth[:20] == 0).all()
    assert_true(found, truth, scale=1.0, same_world=True)


def test_cameras_that_are_transposed_are_no_true_rig():
    truth = box_room(4)
    found = depth_anything_3.predict(da3_double(truth, transposed=True), truth.request())
    with pytest.raises(AssertionError):
        assert_true(found, truth)


def test_numbers_that_are_not_finite_are_refused():
    truth = box_room(2)
    network = da3_double(truth, nested=False)
    whole = network.net.forward
    network.net.forward = lambda *a, **k: (
        whole(*a, **k) | {"extrinsics": torch.full((1, 2, 3, 4), torch.nan)}
    )
    with pytest.raises(BadGeometry, match="not finite"):
        depth_anything_3.predict(network, truth.request())
