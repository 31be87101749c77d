"""Read Depth-Anything-3's Gaussians: one a pixel, in the order of views and pixels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool

from garden_models.reconstruction.geometry_model import Gaussians
from garden_models.reconstruction.similarity import Similarity

SH_C0 = 0.28209479177387814
LEAST_OPACITY = 1 / 255
"""Fainter ones leave no mark on a picture."""


def read_gaussians(
    found: Any, scale_factor: float, keep: Bool[np.ndarray, "n h w"]
) -> tuple[Gaussians, ...]:
    """Return the Gaussians of each view in the world of the predicted cameras.

    ``found`` holds means (1, g, 3), scales, rotations wxyz, opacities and spherical harmonics
    channel by channel (1, g, 3, k), of which the first is the colour that is the same from
    everywhere. Nested networks scale depths and cameras by ``scale_factor``, but not these.
    Those of pixels that ``keep`` leaves out, and those that nobody would see, are dropped.
    """
    views = len(keep)

    def by_view(tensor: Any, *shape: int) -> np.ndarray:
        array: np.ndarray = tensor.float().cpu().numpy()
        return array.reshape(views, -1, *shape)

    harmonics = found.harmonics.float().cpu().numpy()
    means, scales = by_view(found.means, 3), by_view(found.scales, 3)
    rotations, opacities = by_view(found.rotations, 4), by_view(found.opacities)
    colours = harmonics[..., 0].reshape(views, -1, 3) * SH_C0 + 0.5
    out = []
    for i in range(views):
        use = keep[i].reshape(-1) & (opacities[i] > LEAST_OPACITY)
        rotation = rotations[i][use]
        length = np.maximum(np.linalg.norm(rotation, axis=1, keepdims=True), 1e-12)
        out.append(
            Gaussians(
                mean=means[i][use] * np.float32(scale_factor),
                scale=scales[i][use] * np.float32(scale_factor),
                rotation=rotation / length,
                opacity=np.clip(opacities[i][use], 0, 1),
                rgb=np.clip(colours[i][use], 0, 1),
                view=np.full(int(use.sum()), i),
            )
        )
    return tuple(out)


def moved_by_view(parts: Sequence[Gaussians], moves: Sequence[Similarity]) -> tuple[Gaussians, ...]:
    """Return each view's Gaussians moved as its camera was."""
    return tuple(move.gaussians(part) for part, move in zip(parts, moves, strict=True))
