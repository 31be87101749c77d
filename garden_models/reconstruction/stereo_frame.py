"""Hold what stereo needs of a photo at one resolution, and how two photos relate.

A surface point of the reference photo at pixel p (homogeneous, centres at +0.5) with inverse
depth w appears in another photo at the pixel of ``A @ p + b * w``. Planes are linear in
inverse depth: w(x, y) = w0 + gx * dx + gy * dy, which is why everything here works on
inverse depths and not on depths.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor

from garden_models.geometry.camera import resize_intrinsics
from garden_models.reconstruction.undistort import WorkingView


@dataclass(frozen=True)
class StereoFrame:
    """A photo at one pyramid level: ``grey`` in 0..1, ``K`` (float64) for its size."""

    grey: Float[Tensor, "h w"]
    K: Float[np.ndarray, "3 3"]
    camera_from_world: Float[np.ndarray, "3 4"]

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) in pixels."""
        return self.grey.shape[0], self.grey.shape[1]


@dataclass(frozen=True)
class PairGeometry:
    """``A`` and ``b`` of the module docstring, in pixels of the two frames' levels."""

    A: Float[Tensor, "3 3"]
    b: Float[Tensor, "3"]


def stereo_frame(view: WorkingView, factor: float, device: torch.device) -> StereoFrame:
    """Return the frame of a view shrunk by ``factor`` (1 = working size, 4 = a quarter)."""
    luma = view.rgb.astype(np.float32) @ np.array([0.299, 0.587, 0.114], np.float32) / 255.0
    grey = torch.from_numpy(luma)
    width, height = view.size
    size = (max(1, round(width / factor)), max(1, round(height / factor)))
    if factor != 1:
        shrunk = F.interpolate(
            grey[None, None], (size[1], size[0]), mode="bilinear", antialias=True
        )
        grey = shrunk[0, 0]
    K = resize_intrinsics(view.K, view.size, size)
    return StereoFrame(grey.to(device), K, view.camera_from_world)


def pair_geometry(reference: StereoFrame, other: StereoFrame) -> PairGeometry:
    """Return how pixels and inverse depths of ``reference`` map to pixels of ``other``."""
    rotation = other.camera_from_world[:, :3] @ reference.camera_from_world[:, :3].T
    translation = other.camera_from_world[:, 3] - rotation @ reference.camera_from_world[:, 3]
    A = other.K @ rotation @ np.linalg.inv(reference.K)
    b = other.K @ translation
    device = reference.grey.device
    return PairGeometry(
        torch.tensor(A, dtype=torch.float32, device=device),
        torch.tensor(b, dtype=torch.float32, device=device),
    )


def homogeneous_pixels(height: int, width: int, device: torch.device) -> Float[Tensor, "3 h w"]:
    """Return (x, y, 1) of all pixel centres."""
    y, x = torch.meshgrid(
        torch.arange(height, device=device, dtype=torch.float32) + 0.5,
        torch.arange(width, device=device, dtype=torch.float32) + 0.5,
        indexing="ij",
    )
    return torch.stack([x, y, torch.ones_like(x)])


def parallax_per_inverse_depth(
    reference: StereoFrame, partners: list[StereoFrame], w: Float[Tensor, "h w"]
) -> Float[Tensor, "h w"]:
    """Return how far (pixels, mean over partners) a point moves per unit of inverse depth."""
    height, width = reference.shape
    pixels = homogeneous_pixels(height, width, reference.grey.device)
    total = torch.zeros_like(w)
    for partner in partners:
        pair = pair_geometry(reference, partner)
        x, y, z = torch.einsum("ij,jhw->ihw", pair.A, pixels) + pair.b[:, None, None] * w
        z = z.clamp(min=1e-6)
        x, y = x / z, y / z
        motion_x = (pair.b[0] - x * pair.b[2]) / z
        motion_y = (pair.b[1] - y * pair.b[2]) / z
        total += torch.sqrt(motion_x**2 + motion_y**2)
    return (total / len(partners)).clamp_(min=1e-12)
