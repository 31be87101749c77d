"""Estimate depth by a plain plane sweep: the peer that our stereo is measured against.

Collins (1996), as commonly written in torch: normalised cross-correlation over fronto-parallel
planes evenly spaced in inverse depth, the mean over all partners, the best plane wins, and a
depth is kept where it correlates and a partner agrees.
"""

from __future__ import annotations

import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor

from garden_models.geometry.camera import backproject_depth, pixel_grid, pixel_rays, project
from garden_models.reconstruction.stereo_plan import StereoPlan
from garden_models.reconstruction.undistort import WorkingView

PLANES = 64
WINDOW = 7
PLANES_AT_ONCE = 8
LEAST_CORRELATION = 0.5
AGREEMENT = 0.01
"""Two photos agree where their depths differ by less than this share."""


def plain_plane_sweep(plan: StereoPlan) -> list[Float[np.ndarray, "h w"]]:
    """Return every view's z-depth (0: none), in the order of ``plan.views``."""
    raw = {i: _sweep(plan, i) for i in plan.matchable}
    depths = [np.zeros(view.size[::-1]) for view in plan.views]
    for i, depth in raw.items():
        agreed = [_agrees(plan.views[i], depth, plan.views[j], raw[j]) for j in plan.partners[i]]
        depths[i] = np.where(np.any(agreed, axis=0), depth, 0.0)
    return depths


@torch.no_grad()
def _sweep(plan: StereoPlan, i: int) -> Float[np.ndarray, "h w"]:
    view = plan.views[i]
    inverse_depths = torch.linspace(*plan.limits[i], PLANES)
    grey = _grey(view)
    score = torch.zeros(PLANES, *grey.shape)
    for j in plan.partners[i]:
        for start in range(0, PLANES, PLANES_AT_ONCE):
            some = inverse_depths[start : start + PLANES_AT_ONCE]
            warped = _warp(view, plan.views[j], some)
            score[start : start + PLANES_AT_ONCE] += _correlation(grey, warped)
    score /= len(plan.partners[i])
    best = score.argmax(0).clamp(1, PLANES - 2)
    before, at, after = (score.gather(0, (best + k)[None])[0] for k in (-1, 0, 1))
    shift = (before - after) / (2 * (before + after - 2 * at)).clamp(max=-1e-6)
    spacing = inverse_depths[1] - inverse_depths[0]
    w = inverse_depths[best] + shift.clamp(-0.5, 0.5) * spacing
    return torch.where(at > LEAST_CORRELATION, 1 / w, 0.0).double().numpy()


def _grey(view: WorkingView) -> Float[Tensor, "h w"]:
    return torch.from_numpy(view.rgb.astype(np.float32).mean(-1) / 255)


def _warp(
    view: WorkingView, partner: WorkingView, inverse_depths: Float[Tensor, " d"]
) -> Float[Tensor, "d h w"]:
    """Return the partner's photo as it would be seen by the view on each plane."""
    width, height = view.size
    rotation = partner.camera_from_world[:, :3] @ view.camera_from_world[:, :3].T
    offset = partner.camera_from_world[:, 3] - rotation @ view.camera_from_world[:, 3]
    rays = pixel_rays(pixel_grid(height, width), view.K)
    far = torch.from_numpy((rays @ rotation.T @ partner.K.T).astype(np.float32))
    near = torch.from_numpy((partner.K @ offset).astype(np.float32))
    x, y, z = (far + inverse_depths[:, None, None, None] * near).unbind(-1)
    scale = 2 / z.clamp(min=1e-6)
    grid = torch.stack([x * scale / partner.size[0] - 1, y * scale / partner.size[1] - 1], -1)
    grid = torch.where((z > 1e-6)[..., None], grid, torch.full_like(grid, 9.0))
    source = _grey(partner).expand(len(inverse_depths), 1, *partner.size[::-1])
    return F.grid_sample(source, grid, align_corners=False)[:, 0]


def _correlation(grey: Float[Tensor, "h w"], warped: Float[Tensor, "d h w"]) -> Tensor:
    def mean(image: Tensor) -> Tensor:
        across = F.avg_pool2d(
            image[:, None], (1, WINDOW), 1, (0, WINDOW // 2), count_include_pad=False
        )
        return F.avg_pool2d(across, (WINDOW, 1), 1, (WINDOW // 2, 0), count_include_pad=False)[:, 0]

    own = grey[None]
    own_mean, warped_mean = mean(own), mean(warped)
    own_variance = (mean(own**2) - own_mean**2).clamp(min=1e-5)
    warped_variance = (mean(warped**2) - warped_mean**2).clamp(min=1e-5)
    covariance = mean(own * warped) - own_mean * warped_mean
    return covariance / (own_variance * warped_variance).sqrt()


def _agrees(
    view: WorkingView,
    depth: Float[np.ndarray, "h w"],
    partner: WorkingView,
    partner_depth: Float[np.ndarray, "h w"],
) -> np.ndarray:
    """Tell at which pixels the partner found the same surface."""
    height, width = depth.shape
    points_world = backproject_depth(depth, view.K, view.camera_from_world).reshape(-1, 3)
    pixels, z = project(points_world, partner.K, partner.camera_from_world)
    pixels = np.nan_to_num(pixels, nan=-1.0, posinf=-1.0, neginf=-1.0)
    column, row = np.floor(np.clip(pixels, -1, 1e6)).astype(int).T
    inside = (z > 0) & (column >= 0) & (row >= 0)
    inside &= (column < partner.size[0]) & (row < partner.size[1])
    found = np.zeros(len(z))
    found[inside] = partner_depth[row[inside], column[inside]]
    same = np.abs(found - z) < AGREEMENT * np.maximum(z, 1e-12)
    return (same & (found > 0)).reshape(height, width) & (depth > 0)
