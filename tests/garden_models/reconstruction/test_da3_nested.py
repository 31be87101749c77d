"""The nested network and its Gaussians: the real classes, made small, with random weights."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import torch

from garden_models.reconstruction import da3_network, da3_photos
from garden_models.reconstruction.da3_network import load_network
from garden_models.reconstruction.depth_anything_3 import load, predict
from garden_models.reconstruction.geometry_model import GeometryRequest
from garden_models.scene import BadInput
from tests.doubles.true_views import box_room

pytest.importorskip("depth_anything_3")
pytestmark = pytest.mark.slow
SMALL_HEAD = {"features": 32, "out_channels": [16, 16, 16, 16]}


@pytest.fixture(scope="module")
def evo():
    """What the adapter of Gaussians imports of evo, which only aligns given cameras."""
    patch = pytest.MonkeyPatch()
    for name in ("evo", "evo.core", "evo.core.trajectory"):
        patch.setitem(sys.modules, name, ModuleType(name))
    sys.modules["evo.core.trajectory"].PosePath3D = object
    patch.setattr(da3_network, "gaussians_installed", lambda: True)
    patch.setattr(da3_photos, "LONG_SIDE", 112)
    yield
    patch.undo()


@pytest.fixture(scope="module")
def weights(evo, tmp_path_factory) -> Path:
    from depth_anything_3.cfg import create_object, load_config
    from depth_anything_3.registry import MODEL_REGISTRY
    from omegaconf import OmegaConf
    from safetensors.torch import save_file

    folder = tmp_path_factory.mktemp("nested")
    small, giant = (load_config(MODEL_REGISTRY[name]) for name in ("da3-small", "da3-giant"))
    metric = load_config(MODEL_REGISTRY["da3metric-large"])
    anyview = OmegaConf.merge(small, {"head": SMALL_HEAD})
    # Without bands of colour beyond the first, which need e3nn to be turned.
    anyview.gs_adapter = OmegaConf.merge(giant.gs_adapter, {"sh_degree": 0})
    anyview.gs_head = OmegaConf.merge(giant.gs_head, SMALL_HEAD, {"dim_in": 768, "output_dim": 14})
    metric = OmegaConf.merge(
        metric,
        {
            "net": {"name": "vits", "out_layers": [2, 5, 8, 11]},
            "head": SMALL_HEAD | {"dim_in": 384},
        },
    )
    nested = load_config(MODEL_REGISTRY["da3nested-giant-large"])
    nested.anyview, nested.metric = anyview, metric
    OmegaConf.save(nested, folder / "nested.yaml")
    patch = pytest.MonkeyPatch()
    patch.setitem(MODEL_REGISTRY, "da3nested-giant-large", str(folder / "nested.yaml"))
    torch.manual_seed(0)
    net = create_object(load_config(MODEL_REGISTRY["da3nested-giant-large"]))
    state = {f"model.{name}": w.contiguous().clone() for name, w in net.state_dict().items()}
    save_file(state, folder / "model.safetensors")
    (folder / "config.json").write_text(json.dumps({"model_name": "da3nested-giant-large"}))
    yield folder
    patch.undo()


def test_gaussians_are_brought_to_the_metres_of_the_depth(weights):
    truth = box_room(3)
    request = truth.request(want_gaussians=True, want_tokens=True)
    network = load_network(weights, "cpu")
    assert network.nested and network.gaussians and network.poses
    found = predict(network, request)
    assert found.metric and found.camera_tokens[0].tokens.shape == (3, 768)
    own = _own(network, request)
    factor = own["scale_factor"]
    assert factor != pytest.approx(1.0, abs=0.05)
    sky = own["depth_conf"][0].numpy() <= 1
    keep = ~sky.reshape(-1) & (own["gaussians"].opacities[0].numpy() > 1 / 255)
    cloud = found.gaussians
    assert cloud is not None and keep.any()
    raw = own["gaussians"]
    np.testing.assert_allclose(cloud.mean, raw.means[0].numpy()[keep] * factor, rtol=1e-5)
    np.testing.assert_allclose(cloud.scale, raw.scales[0].numpy()[keep] * factor, rtol=1e-5)
    dc = raw.harmonics[0].numpy()[keep][:, :, 0]
    np.testing.assert_allclose(cloud.rgb, np.clip(0.5 + 0.28209479 * dc, 0, 1), atol=1e-6)
    depth = own["depth"][0].numpy() * ~sky
    for i, view in enumerate(found.views):
        np.testing.assert_array_equal(view.depth, depth[i])
        np.testing.assert_allclose(
            view.camera_from_world, own["extrinsics"][0, i].numpy(), atol=1e-5
        )


def test_with_given_cameras_gaussians_move_as_their_cameras_do(weights):
    truth = box_room(3)
    network = load_network(weights, "cpu")
    request = truth.with_cameras(want_gaussians=True)
    found = predict(network, request)
    cloud = found.gaussians
    assert cloud is not None
    np.testing.assert_allclose(
        np.stack([v.camera_from_world for v in found.views]), truth.camera_from_world, atol=1e-12
    )
    for i, view in enumerate(found.views):
        own = cloud.subset(cloud.view == i)
        local = own.mean @ view.camera_from_world[:, :3].T + view.camera_from_world[:, 3]
        # The network puts them along unit rays, by its depth and a small offset.
        distance = np.linalg.norm(local, axis=1)
        depth = view.depth.reshape(-1)
        ratio = np.median(distance) / np.median(depth[depth > 0])
        assert 0.3 < ratio < 3


def test_without_their_packages_gaussians_are_left_out_and_refused(weights, monkeypatch):
    truth = box_room(3)
    whole = load(weights, "cpu")(truth.request())
    monkeypatch.setattr(da3_network, "gaussians_installed", lambda: False)
    bare = load(weights, "cpu")
    found = bare(truth.request())
    np.testing.assert_array_equal(found.views[1].depth, whole.views[1].depth)
    with pytest.raises(BadInput, match="evo and e3nn"):
        bare(truth.request(want_gaussians=True))


def _own(network, request: GeometryRequest):
    pictures, _ = da3_photos.prepare(request.photos)
    with torch.inference_mode():
        return network.net(torch.from_numpy(pictures)[None], export_feat_layers=[], infer_gs=True)
