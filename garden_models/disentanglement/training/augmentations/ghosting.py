"""Add spatially coherent duplicate layers with a drift (paper: multi-layer ghosting)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from garden_models.disentanglement.training.augmentations.config import Ghosting
from garden_models.disentanglement.training.pair import LabelledCloud


def add_ghosts(
    cloud: LabelledCloud, rng: np.random.Generator, config: Ghosting, voxel: float
) -> LabelledCloud:
    """Return the cloud with 5 to 12 more layers; a copy keeps its original's label.

    A layer repeats the points nearest to a random one, shifted by 0.2 to 0.5 ``voxel``
    (metres) in one random direction.
    """
    points, labels = [cloud.points], [cloud.label]
    for _ in range(int(rng.integers(config.layers[0], config.layers[1] + 1))):
        centre = cloud.points[int(rng.integers(len(cloud.points)))]
        count = max(1, int(rng.uniform(*config.patch) * len(cloud.points)))
        squared = np.square(cloud.points - centre).sum(axis=1)
        patch = np.argpartition(squared, count - 1)[:count]
        drift = rng.uniform(*config.drift_voxels) * voxel * _direction(rng)
        points.append(cloud.points[patch] + drift)
        labels.append(cloud.label[patch])
    return LabelledCloud(np.concatenate(points), np.concatenate(labels))


def _direction(rng: np.random.Generator) -> Float[np.ndarray, "3"]:
    vector = rng.normal(0, 1, 3)
    return np.asarray(vector / np.linalg.norm(vector))
