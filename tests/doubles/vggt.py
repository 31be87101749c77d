"""VGGT answering with the truth: the class and the inputs that its source states."""

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
from garden_models.geometry.rotation import quaternion_from_matrix
from tests.doubles.true_views import TrueViews


class VGGT(nn.Module):
    """Ctor and ``forward`` as in ``vggt.models.vggt``; ``truth`` is what it knows."""

    truth: ClassVar[TrueViews]
    unit: ClassVar[float] = 0.4

    def __init__(
        self,
        img_size: int = 518,
        patch_size: int = 14,
        embed_dim: int = 1024,
        enable_camera: bool = True,
        enable_point: bool = True,
        enable_depth: bool = True,
        enable_track: bool = True,
    ) -> None:
        super().__init__()
        self.aggregator = nn.Linear(2, 2)
        self.camera_head = nn.Linear(2, 2) if enable_camera else None
        self.point_head = nn.Linear(2, 2) if enable_point else None
        self.depth_head = nn.Linear(2, 2) if enable_depth else None
        self.track_head = nn.Linear(2, 2) if enable_track else None

    def forward(self, images: Tensor, query_points: Tensor | None = None) -> dict[str, Any]:
        if images.ndim == 4:
            images = images[None]
        assert images.dtype == torch.float32 and images.shape[2] == 3, images.shape
        height, width = images.shape[-2:]
        assert width == 518 and height % 14 == 0 and height <= 518, images.shape
        assert float(images.min()) >= 0 and float(images.max()) <= 1
        pictures = images[0].permute(0, 2, 3, 1).numpy() * 255
        found = self.truth.recognised(pictures, cut=True)
        world = invert_rigid(self.truth.camera_from_world[found[0]])
        encodings, depths = [], []
        for index in found:
            camera = homogeneous(self.truth.camera_from_world[index]) @ world
            rows, columns = self.truth.photos[index].shape[:2]
            whole = (518, round(rows * 518 / columns / 14) * 14)
            K = self.truth.model_intrinsics(index, whole, (width, height))
            w, x, y, z = quaternion_from_matrix(camera[:3, :3])
            fov = 2 * np.arctan([height / 2 / K[1, 1], width / 2 / K[0, 0]])
            encodings.append(np.r_[camera[:3, 3] / self.unit, x, y, z, w, fov])
            depths.append(self.truth.depth_at(index, K, (width, height)) / self.unit)
        depth = torch.from_numpy(np.stack(depths).astype(np.float32))[None, ..., None]
        return {
            "pose_enc": torch.from_numpy(np.stack(encodings).astype(np.float32))[None],
            "depth": depth,
            "depth_conf": torch.full(depth.shape[:-1], 4.0),
            "images": images,
        }


def install_vggt(
    truth: TrueViews, folder: Path, monkeypatch: pytest.MonkeyPatch, config: str = ""
) -> None:
    """Make ``vggt`` importable and put weights into a folder, with the heads nobody needs."""
    from safetensors.torch import save_file

    module = ModuleType("vggt.models.vggt")
    module.VGGT = VGGT  # type: ignore[attr-defined]
    for name in ("vggt", "vggt.models"):
        monkeypatch.setitem(sys.modules, name, ModuleType(name))
    monkeypatch.setitem(sys.modules, "vggt.models.vggt", module)
    monkeypatch.setattr(VGGT, "truth", truth, raising=False)
    folder.mkdir(parents=True, exist_ok=True)
    save_file(VGGT().state_dict(), folder / "model.safetensors")
    if config:
        (folder / "config.json").write_text(config)
