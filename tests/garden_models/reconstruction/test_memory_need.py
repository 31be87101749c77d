"""The memory that Depth-Anything-3 needs is counted on its real class and obeys the formula."""

from __future__ import annotations

import json
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves

from garden_models.reconstruction import depth_anything_3, pi3, vggt
from garden_models.reconstruction.da3_memory import EARLY, floats
from garden_models.reconstruction.geometry_model import GeometryRequest


class AliveTensors(TorchDispatchMode):
    """Counts the bytes of all tensors that are alive; those of ``net`` do not count."""

    def __init__(self, net: torch.nn.Module) -> None:
        super().__init__()
        own = [*net.parameters(), *net.buffers()]
        self.known = {tensor.untyped_storage()._cdata for tensor in own}
        self.now = self.peak = 0

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        out = func(*args, **(kwargs or {}))
        for tensor in tree_leaves(out):
            if isinstance(tensor, torch.Tensor):
                self._count(tensor.untyped_storage())
        return out

    def _count(self, storage: torch.UntypedStorage) -> None:
        key, size = storage._cdata, storage.nbytes()
        if key in self.known:
            return
        self.known.add(key)
        self.now += size
        self.peak = max(self.peak, self.now)
        weakref.finalize(storage, self._gone, key, size)

    def _gone(self, key: int, size: int) -> None:
        self.known.discard(key)
        self.now -= size


@pytest.mark.slow
def test_the_formula_holds_for_the_real_network():
    pytest.importorskip("depth_anything_3")
    from depth_anything_3.cfg import create_object, load_config
    from depth_anything_3.registry import MODEL_REGISTRY

    net = create_object(load_config(MODEL_REGISTRY["da3-small"])).eval().requires_grad_(False)
    for size in ((154, 112), (224, 168)):
        per_photo, per_early = floats("da3-small", size, gaussians=False)
        for count in (6, 11):
            with torch.no_grad(), AliveTensors(net) as alive:
                net(torch.zeros(1, count, 3, size[1], size[0]), None, None, export_feat_layers=[])
            expected = 4 * (per_photo * count + per_early * min(count, EARLY))
            assert 0.94 < alive.peak / expected < 1.06, (size, count)


def folder_of(path: Path, gigabytes: float, **config: str) -> Path:
    path.mkdir()
    with (path / "model.safetensors").open("wb") as file:
        file.truncate(int(gigabytes * 1e9))
    (path / "config.json").write_text(json.dumps(config))
    return path


def test_hundreds_of_photos_of_the_giant_fit_a_large_gpu(tmp_path):
    folder = folder_of(tmp_path / "da3", 6.76, model_name="da3nested-giant-large")
    photos = (np.zeros((1080, 1440, 3), np.uint8),)
    need = depth_anything_3.memory_need(folder, GeometryRequest(photos))
    assert 60 < need.most_photos(24) < 200
    assert need.most_photos(80) > 400 and need.most_photos(6) == 0
    with_gaussians = depth_anything_3.memory_need(
        folder, GeometryRequest(photos, want_gaussians=True)
    )
    assert with_gaussians.most_photos(80) < need.most_photos(80) / 1.5


def test_vggt_obeys_its_own_table(tmp_path):
    folder = folder_of(tmp_path / "vggt", 0.0)
    photos = (np.zeros((672, 1036, 3), np.uint8),)
    need = vggt.memory_need(folder, GeometryRequest(photos))
    assert need.gb(200) - need.gb(10) == pytest.approx(40.63 - 3.63, rel=0.01)


def test_pi3_with_cameras_needs_more(tmp_path):
    from safetensors.torch import save_file

    tmp_path.joinpath("pi3").mkdir()
    save_file({"metric_token": torch.zeros(1)}, tmp_path / "pi3" / "model.safetensors")
    photos = (np.zeros((600, 800, 3), np.uint8),)
    free = pi3.memory_need(tmp_path / "pi3", GeometryRequest(photos))
    K, camera = np.eye(3)[None], np.eye(4)[None, :3]
    given = pi3.memory_need(tmp_path / "pi3", GeometryRequest(photos, K, camera))
    assert given.most_photos(80) < free.most_photos(80) / 2
