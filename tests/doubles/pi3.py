"""Pi3 and Pi3X answering with the truth: the classes and the inputs that their source states."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from garden_models.geometry.rigid import homogeneous, invert_rigid
from garden_models.geometry.rotation import axis_angle
from tests.doubles.true_views import TrueViews


class Pi3(nn.Module):
    """As ``pi3.models.pi3.Pi3``: world of its own, unit of its own, no intrinsics."""

    truth: ClassVar[TrueViews]
    unit: ClassVar[float] = 3.0

    def __init__(self, pos_type: str = "rope100", decoder_size: str = "large") -> None:
        super().__init__()
        self.decoder = nn.Linear(2, 2)

    def forward(self, imgs: Tensor) -> dict[str, Tensor]:
        return self.answer(imgs)[0]

    def answer(self, imgs: Tensor) -> tuple[dict[str, Tensor], list[int], list[np.ndarray]]:
        assert imgs.dtype == torch.float32 and imgs.ndim == 5 and imgs.shape[2] == 3, imgs.shape
        height, width = imgs.shape[-2:]
        assert height % 14 == 0 and width % 14 == 0 and height * width <= 255_000
        assert float(imgs.min()) >= 0 and float(imgs.max()) <= 1
        found = self.truth.recognised(imgs[0].permute(0, 2, 3, 1).numpy() * 255, cut=True)
        odd = np.eye(4)
        odd[:3, :3], odd[:3, 3] = axis_angle(np.array([1.0, 2.0, 0.5]), 1.1), (4.0, -2.0, 1.0)
        poses, points, Ks = [], [], []
        for index in found:
            rows, columns = self.truth.photos[index].shape[:2]
            K = self.truth.model_intrinsics(index, _whole_size(columns, rows), (width, height))
            depth = self.truth.depth_at(index, K, (width, height))
            u, v = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
            rays = np.stack([(u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1], np.ones_like(u)], -1)
            pose = odd @ invert_rigid(homogeneous(self.truth.camera_from_world[index]))
            pose[:3, 3] /= self.unit
            poses.append(pose)
            points.append(rays * depth[..., None] / self.unit)
            Ks.append(K)
        shape = (1, len(found), height, width, 1)
        out = {
            "local_points": _tensor(np.stack(points)),
            "conf": torch.full(shape, 2.0),
            "camera_poses": _tensor(np.stack(poses)),
        }
        return out, found, Ks


class Pi3X(Pi3):
    """As ``pi3.models.pi3x.Pi3X``: metres, and cameras may be given, as world_from_camera."""

    unit: ClassVar[float] = 1.0

    def __init__(self, ckpt: Any = None, use_multimodal: bool = True) -> None:
        super().__init__()
        self.metric_token = nn.Parameter(torch.zeros(1))

    def forward(  # type: ignore[override]
        self,
        imgs: Tensor,
        depths: Tensor | None = None,
        intrinsics: Tensor | None = None,
        rays: Tensor | None = None,
        poses: Tensor | None = None,
        with_prior: bool = True,
    ) -> dict[str, Tensor]:
        out, found, Ks = self.answer(imgs)
        if poses is not None:
            assert intrinsics is not None, "poses need rays or intrinsics"
            assert poses.shape == (1, len(found), 4, 4) and intrinsics.shape == (
                1,
                len(found),
                3,
                3,
            )
            given = poses[0].double().numpy()
            true = np.stack([invert_rigid(self.truth.camera_from_world[i]) for i in found])
            relative = np.linalg.inv(given[0]) @ given
            wanted = np.linalg.inv(true[0]) @ true
            np.testing.assert_allclose(relative[:, :3, :3], wanted[:, :3, :3], atol=1e-4)
            np.testing.assert_allclose(intrinsics[0].numpy(), np.stack(Ks), rtol=1e-4, atol=1e-3)
        return out | {"metric": torch.ones(1)}


def install_pi3(
    truth: TrueViews, folder: Path, monkeypatch: pytest.MonkeyPatch, metric: bool
) -> None:
    """Make ``pi3`` importable and put Pi3X's (``metric``) or Pi3's weights into a folder."""
    from safetensors.torch import save_file

    for name in ("pi3", "pi3.models"):
        monkeypatch.setitem(sys.modules, name, ModuleType(name))
    for name, kind in (("pi3", Pi3), ("pi3x", Pi3X)):
        module = ModuleType(f"pi3.models.{name}")
        setattr(module, kind.__name__, kind)
        monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setattr(Pi3, "truth", truth, raising=False)
    folder.mkdir(parents=True, exist_ok=True)
    save_file((Pi3X if metric else Pi3)().state_dict(), folder / "model.safetensors")


def _whole_size(width: int, height: int) -> tuple[int, int]:
    """About 255,000 pixels in multiples of 14 (pi3/utils/basic.py)."""
    scale = np.sqrt(255_000 / (width * height))
    k, m = round(width * scale / 14), round(height * scale / 14)
    while k * m * 196 > 255_000:
        if k / m > width / height:
            k -= 1
        else:
            m -= 1
    return k * 14, m * 14


def _tensor(array: np.ndarray) -> Tensor:
    return torch.from_numpy(np.ascontiguousarray(array, np.float32))[None]
