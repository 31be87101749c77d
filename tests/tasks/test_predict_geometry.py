"""The real Depth-Anything-3 (random weights) asked as a step asks it: here and in a worker."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
import torch

from garden_models.reconstruction.geometry_model import GeometryPrediction, GeometryRequest
from tasks.model import backend_of, predictor
from tasks.model.resident import residents

pytest.importorskip("depth_anything_3")
pytestmark = pytest.mark.slow
METHOD = "depth_anything_3"


@pytest.fixture
def settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    from depth_anything_3.cfg import create_object, load_config
    from depth_anything_3.registry import MODEL_REGISTRY
    from safetensors.torch import save_file

    torch.manual_seed(0)
    net = create_object(load_config(MODEL_REGISTRY["da3-small"]))
    folder = tmp_path / "weights" / METHOD
    folder.mkdir(parents=True)
    state = {f"model.{name}": w.contiguous().clone() for name, w in net.state_dict().items()}
    save_file(state, folder / "model.safetensors")
    (folder / "config.json").write_text(json.dumps({"model_name": "da3-small"}))
    monkeypatch.setenv("GARDEN_WEIGHTS", str(tmp_path / "weights"))
    monkeypatch.setenv("GARDEN_MODELS", str(tmp_path / "models.toml"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "models.toml").write_text("")
    residents.free()
    yield tmp_path / "models.toml"
    residents.free()


def ask() -> GeometryPrediction:
    rng = np.random.default_rng(0)
    photos = tuple(rng.integers(0, 255, (60, 80, 3), dtype=np.uint8) for _ in range(3))
    with predictor(METHOD) as predict:
        found: GeometryPrediction = predict(GeometryRequest(photos, want_tokens=True))
    return found


def test_a_worker_process_answers_as_this_process_does(settings: Path) -> None:
    assert backend_of(METHOD) == "depth_anything_3/da3-small"
    here = ask()
    settings.write_text(f'[{METHOD}]\npython = "{sys.executable}"\n')
    there = ask()
    assert len(here.views) == 3 and here.views[0].depth.shape == (378, 504)
    for a, b in zip(here.views, there.views, strict=True):
        np.testing.assert_allclose(a.depth, b.depth, rtol=1e-4)
        np.testing.assert_allclose(a.camera_from_world, b.camera_from_world, atol=1e-4)
        np.testing.assert_allclose(a.K, b.K, rtol=1e-4)
        np.testing.assert_array_equal(a.seen, b.seen)
    assert here.camera_tokens[0].kind == there.camera_tokens[0].kind == "da3-small"
    assert here.camera_tokens[0].reference == there.camera_tokens[0].reference
