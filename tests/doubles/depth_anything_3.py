"""Depth-Anything-3 answering with the truth, in the conventions that its source states.

What it is given is held against the same source: ImageNet statistics, sides of at most 504 in
multiples of 14, cameras as ``camera_from_world`` with the first one as the world.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from garden_models.geometry.rigid import homogeneous, invert_rigid
from garden_models.geometry.rotation import quaternion_from_matrix
from garden_models.reconstruction.da3_network import Da3Network
from tests.doubles.true_views import TrueViews

SH_C0 = 0.28209479177387814
MEAN = torch.tensor([0.485, 0.456, 0.406])[:, None, None]
STD = torch.tensor([0.229, 0.224, 0.225])[:, None, None]
WIDTH = 6
LONG_SIDE = 504
"""Of the source; smaller in tests that have no time."""


class GaussianAdapter(nn.Module):
    """Shifts Gaussians towards given cameras, by a factor that it keeps to itself."""

    def forward(self, means: Tensor, gt_extrinsics: Tensor | None = None) -> Tensor:
        return means if gt_extrinsics is None else means * 1.7


class AnyView(nn.Module):
    """The part that predicts cameras; its unit is ``unit`` metres."""

    def __init__(self, truth: TrueViews, unit: float, transposed: bool) -> None:
        super().__init__()
        self.truth, self.unit, self.transposed = truth, unit, transposed
        self.backbone = nn.Module()
        self.backbone.pretrained = nn.Module()
        self.backbone.pretrained.alt_start = 3
        self.backbone.pretrained.blocks = nn.ModuleList(nn.Identity() for _ in range(4))
        self.cam_dec, self.gs_head, self.gs_adapter = nn.Identity(), nn.Identity(), None
        self.gs_adapter = GaussianAdapter()
        self.anything = nn.Parameter(torch.zeros(1))

    def forward(
        self,
        x: Tensor,
        extrinsics: Tensor | None = None,
        intrinsics: Tensor | None = None,
        export_feat_layers: list[int] | None = None,
        infer_gs: bool = False,
        use_ray_pose: bool = False,
        ref_view_strategy: str = "saddle_balanced",
    ) -> dict[str, Any]:
        found = self.truth.recognised(self._pictures(x), cut=True)
        height, width = x.shape[-2:]
        reference = self._reference(found, extrinsics)
        world = invert_rigid(self.truth.camera_from_world[found[reference]])
        cameras, Ks, depths = [], [], []
        for index in found:
            camera = homogeneous(self.truth.camera_from_world[index]) @ world
            camera[:3, 3] /= self.unit
            if self.transposed:
                camera[:3, :3] = camera[:3, :3].T
            rows, columns = self.truth.photos[index].shape[:2]
            whole = _whole_size(columns, rows)
            K = self.truth.model_intrinsics(index, whole, (width, height))
            if extrinsics is not None:
                self._check_cameras(extrinsics, intrinsics, found, Ks, K)
            cameras.append(camera[:3])
            Ks.append(K)
            depths.append(self.truth.depth_at(index, K, (width, height)) / self.unit)
        self.cam_dec(self.tokens(found)[None])
        out = {
            "depth": _tensor(np.stack(depths)),
            "depth_conf": torch.full((1, len(found), height, width), 5.0),
            "extrinsics": _tensor(np.stack(cameras)),
            "intrinsics": _tensor(np.stack(Ks)),
        }
        if infer_gs:
            out["gaussians"] = self._gaussians(depths, Ks, cameras, x, extrinsics)
        return out

    def tokens(self, found: list[int]) -> Tensor:
        """Camera tokens: those of a photo are the same wherever it stands."""
        rng = np.random.default_rng(5)
        every = rng.normal(size=(len(self.truth), WIDTH)).astype(np.float32)
        return torch.from_numpy(every[found])

    def _pictures(self, x: Tensor) -> np.ndarray:
        assert x.dtype == torch.float32 and x.ndim == 5 and x.shape[:1] == (1,), x.shape
        assert x.shape[2] == 3 and max(x.shape[-2:]) <= LONG_SIDE
        assert x.shape[-1] % 14 == 0 and x.shape[-2] % 14 == 0, x.shape
        pictures = (x[0].cpu() * STD + MEAN).permute(0, 2, 3, 1).numpy()
        assert pictures.min() > -0.02 and pictures.max() < 1.02, "not ImageNet's statistics"
        return pictures * 255

    def _reference(self, found: list[int], extrinsics: Tensor | None) -> int:
        from depth_anything_3.model.reference_view_selector import select_reference_view

        tokens = torch.cat([self.tokens(found)[:, None]] * 2, dim=1)
        self.backbone.pretrained.blocks[self.backbone.pretrained.alt_start - 2](tokens)
        if len(found) < 3 or extrinsics is not None:
            return 0
        return int(select_reference_view(tokens[None], "saddle_balanced")[0])

    def _check_cameras(
        self, extrinsics: Tensor, intrinsics: Tensor | None, found: list[int], seen: list, K: Any
    ) -> None:
        given = extrinsics[0].double().cpu().numpy()
        assert given.shape == (len(found), 4, 4) and intrinsics is not None
        np.testing.assert_allclose(given[0], np.eye(4), atol=1e-5)
        k = len(seen)
        first = invert_rigid(self.truth.camera_from_world[found[0]])
        true = homogeneous(self.truth.camera_from_world[found[k]]) @ first
        np.testing.assert_allclose(given[k][:3, :3], true[:3, :3], atol=1e-4)
        np.testing.assert_allclose(intrinsics[0, k].cpu().numpy(), K, rtol=1e-4, atol=1e-3)

    def _gaussians(
        self, depths: list, Ks: list, cameras: list, x: Tensor, extrinsics: Tensor | None
    ) -> SimpleNamespace:
        means, turns, harmonics = [], [], []
        pictures = self._pictures(x) / 255
        for depth, K, camera, picture in zip(depths, Ks, cameras, pictures, strict=True):
            height, width = depth.shape
            u, v = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
            rays = np.stack([(u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1], np.ones_like(u)], -1)
            local = (rays * depth[..., None]).reshape(-1, 3)
            world_from_camera = invert_rigid(camera)
            means.append(local @ world_from_camera[:3, :3].T + world_from_camera[:3, 3])
            wxyz = quaternion_from_matrix(world_from_camera[:3, :3])
            turns.append(np.tile(wxyz, (len(local), 1)))
            bands = np.zeros((len(local), 3, 9))
            bands[:, :, 0] = (picture.reshape(-1, 3) - 0.5) / SH_C0
            bands[:, :, 1:] = 9.0
            harmonics.append(bands)
        points = self.gs_adapter(_tensor(np.concatenate(means)), gt_extrinsics=extrinsics)
        spread = np.tile([0.02, 0.02, 0.004], (points.shape[1], 1)) / self.unit
        return SimpleNamespace(
            means=points,
            scales=_tensor(spread),
            rotations=_tensor(np.concatenate(turns)) * 1.5,
            harmonics=_tensor(np.concatenate(harmonics)),
            opacities=_tensor(np.full(points.shape[1], 0.8)),
        )


class Nested(nn.Module):
    """The nested network: depth and cameras come in metres, Gaussians do not."""

    def __init__(self, truth: TrueViews, unit: float, transposed: bool, unscaled: bool) -> None:
        super().__init__()
        self.da3, self.unit, self.unscaled = AnyView(truth, unit, transposed), unit, unscaled

    def forward(self, *args: Any, **kwargs: Any) -> dict[str, Any]:
        out = self.da3(*args, **kwargs)
        out["depth"] *= self.unit
        out["extrinsics"][..., 3] *= self.unit
        return out | {"is_metric": 1, "scale_factor": 1.0 if self.unscaled else self.unit}


def da3_double(
    truth: TrueViews,
    nested: bool = True,
    unit: float = 2.5,
    transposed: bool = False,
    unscaled: bool = False,
) -> Da3Network:
    """Return a network that answers with the truth of photos it recognises.

    Broken on purpose: ``transposed`` cameras, Gaussians whose scale is ``unscaled``.
    """
    kind = "da3nested-giant-large" if nested else "da3-giant"
    net = Nested(truth, unit, transposed, unscaled) if nested else AnyView(truth, unit, transposed)
    return Da3Network(net, kind)


def _whole_size(width: int, height: int) -> tuple[int, int]:
    """Long side first, then both to the nearest multiple of 14, ties up (input_processor.py)."""
    scale = LONG_SIDE / max(width, height)
    sides = [round(width * scale), round(height * scale)]
    return tuple(int(14 * np.floor(side / 14 + 0.5)) for side in sides)  # type: ignore[return-value]


def _tensor(array: np.ndarray) -> Tensor:
    return torch.from_numpy(np.ascontiguousarray(array, np.float32))[None]
