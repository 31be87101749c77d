"""Bend, shift and break slender parts (paper: thin-part deformation)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import cKDTree

from garden_models.disentanglement.training.augmentations.config import ThinParts
from garden_models.disentanglement.training.pair import LabelledCloud

NEIGHBOURS = 32
MOST_ASKED = 2048
"""Points among which neighbours are sought: so few that those within the radius are not more
than ``NEIGHBOURS`` by much."""


def deform_thin_parts(
    cloud: LabelledCloud, rng: np.random.Generator, config: ThinParts, voxel: float
) -> LabelledCloud:
    """Return the cloud, in half of the calls with its slender parts deformed.

    They are moved by a smooth field of up to ``bend_voxels`` and lose up to ``broken`` of
    their points in pieces.
    """
    if rng.random() >= config.probability:
        return cloud
    thin = slender(cloud.points, config.radius_voxels * voxel, config.least_linearity)
    if not thin.any():
        return cloud
    points = cloud.points.copy()
    amplitude = rng.uniform(*config.bend_voxels) * voxel
    points[thin] += amplitude * smooth_field(points[thin], 4 * voxel, 3, rng)
    gone = np.zeros(len(points), bool)
    strength = smooth_field(points[thin], 2 * voxel, 1, rng)[:, 0]
    gone[thin] = strength > np.quantile(strength, 1 - rng.uniform(0, config.broken))
    return LabelledCloud(points, cloud.label).subset(~gone)


def slender(
    points: Float[np.ndarray, "n 3"], radius: float, least_linearity: float
) -> Bool[np.ndarray, " n"]:
    """Tell which points have neighbours within ``radius`` that spread along one line.

    Linearity is (a - b) / a for the two largest standard deviations a and b.
    """
    chosen = points[:: -(-len(points) // MOST_ASKED)]
    tree = cKDTree(chosen)
    distance, index = tree.query(points, k=NEIGHBOURS, distance_upper_bound=radius)
    found = np.isfinite(distance)
    near = chosen[np.where(found, index, 0)]
    weight = found[..., None].astype(float)
    count = np.maximum(weight.sum(axis=1), 1)
    centred = (near - (near * weight).sum(axis=1, keepdims=True) / count[:, None]) * weight
    spread = np.einsum("nki,nkj->nij", centred, centred) / count[..., None]
    deviation = np.sqrt(np.maximum(np.linalg.eigvalsh(spread), 0))
    largest = np.maximum(deviation[:, 2], 1e-12)
    linear = (largest - deviation[:, 1]) / largest > least_linearity
    return np.asarray(linear & (found.sum(axis=1) >= 6))


def smooth_field(
    points: Float[np.ndarray, "n 3"], wavelength: float, dimensions: int, rng: np.random.Generator
) -> Float[np.ndarray, "n d"]:
    """Return a random smooth function of place, about -1 to 1 in each dimension."""
    waves = 5
    direction = rng.normal(0, 1, (3, waves * dimensions)) * 2 * np.pi / wavelength / np.sqrt(3)
    phase = rng.uniform(0, 2 * np.pi, waves * dimensions)
    value = np.sin(points @ direction + phase).reshape(len(points), dimensions, waves)
    return np.asarray(value.sum(axis=2) / np.sqrt(waves))
