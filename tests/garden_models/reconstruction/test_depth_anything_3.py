"""Tokens of Depth-Anything-3, with a small network of random weights (where it is installed)."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import torch

from garden_models.gravity.decoder import da3_tokens
from garden_models.scene import BadInput


def photos(count: int) -> list[np.ndarray]:
    rng = np.random.default_rng(0)
    return [rng.integers(0, 255, (60, 80, 3), dtype=np.uint8) // (k + 1) for k in range(count)]


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("depth_anything_3")
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


@pytest.mark.slow
def test_tokens_are_what_the_camera_decoder_reads_and_the_reference_is_the_chosen_one(
    weights, monkeypatch
):
    import depth_anything_3.model.dinov2.vision_transformer as vision

    monkeypatch.setattr(da3_tokens, "LONG_SIDE", 112)
    net, name = da3_tokens.load_backbone(weights, "cpu")
    assert name == "da3-small"
    chosen: list[int] = []
    select = vision.select_reference_view

    def spy(*args, **kwargs):
        found = select(*args, **kwargs)
        chosen.append(int(found[0]))
        return found

    for count in (2, 3, 5):
        with monkeypatch.context() as patched:
            patched.setattr(vision, "select_reference_view", spy)
            tokens, reference = da3_tokens.camera_tokens(net, photos(count))
        assert tokens.shape == (count, 768)
        assert reference == (0 if count < 3 else chosen[0])
        chosen.clear()
    read: list[torch.Tensor] = []
    net.cam_dec.register_forward_pre_hook(lambda _module, inputs: read.append(inputs[0]))
    with torch.inference_mode():
        net(
            torch.from_numpy(da3_tokens.prepare(photos(5)))[None],
            None,
            None,
            export_feat_layers=[],
            infer_gs=False,
            use_ray_pose=False,
            ref_view_strategy=da3_tokens.STRATEGY,
        )
    np.testing.assert_array_equal(read[0].reshape(5, 768).float().numpy(), tokens)


def test_a_folder_without_a_model_name_is_refused(tmp_path):
    with pytest.raises(BadInput, match=r"no config\.json"):
        da3_tokens.load_backbone(tmp_path, "cpu")
    (tmp_path / "config.json").write_text("{}")
    with pytest.raises(BadInput, match="model_name"):
        da3_tokens.load_backbone(tmp_path, "cpu")
