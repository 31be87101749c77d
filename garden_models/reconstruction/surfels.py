"""Turn oriented points into flat Gaussians, for viewers and renderers of 3DGS."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

THICKNESS = 0.1
"""Standard deviation across the surface as a share of that along it."""

OPACITY = 0.95


@dataclass(frozen=True)
class Surfels:
    """Gaussians in the frame of the points: ``scales`` are standard deviations in metres."""

    means: Float[np.ndarray, "n 3"]
    scales: Float[np.ndarray, "n 3"]
    quaternions_wxyz: Float[np.ndarray, "n 4"]
    opacities: Float[np.ndarray, " n"]


def surfels(
    xyz: Float[np.ndarray, "n 3"],
    normal: Float[np.ndarray, "n 3"],
    spacing: Float[np.ndarray, " n"],
) -> Surfels:
    """Return one disc per point, its z axis along the normal.

    The standard deviation along the surface is half the spacing, so that neighbours
    overlap at one sigma.
    """
    along = np.maximum(0.5 * spacing, 1e-6)
    scales = np.stack([along, along, THICKNESS * along], axis=1)
    opacities = np.full(len(xyz), OPACITY)
    return Surfels(xyz, scales, _quaternions_from_z_to(normal), opacities)


def _quaternions_from_z_to(direction: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 4"]:
    """Return wxyz quaternions of the smallest rotations that turn z to ``direction``."""
    x, y, z = direction.T
    wxyz = np.stack([1 + z, -y, x, np.zeros_like(z)], axis=1)
    length = np.linalg.norm(wxyz, axis=1)
    opposite = length < 1e-6
    wxyz[opposite] = (0.0, 1.0, 0.0, 0.0)
    return wxyz / np.where(opposite, 1.0, length)[:, None]
