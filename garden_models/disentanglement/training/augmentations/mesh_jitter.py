"""Make the condition's pose and scale wrong (paper: mesh pose and scale jittering)."""

from __future__ import annotations

import numpy as np

from garden_models.disentanglement.training.augmentations.config import MeshJitter
from garden_models.disentanglement.training.pair import Condition


def jitter_mesh(
    condition: Condition, rng: np.random.Generator, config: MeshJitter, unit: float
) -> Condition:
    """Return the condition scaled, stretched, turned about gravity and shifted.

    Scaling is about the centre of the box; ``unit`` multiplies the translation.
    """
    low, high = condition.box
    centre = (low + high) / 2
    strength = 0.1 if rng.random() < config.gentle else 1.0
    factor = 1 + strength * (rng.uniform(*config.scale) * rng.uniform(*config.stretch, 3) - 1)
    angle = np.radians(strength * rng.uniform(-config.yaw_deg, config.yaw_deg))
    shift = strength * rng.uniform(-1, 1, 3) * config.translation_m * unit
    c, s = np.cos(angle), np.sin(angle)
    linear = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) * factor

    def moved(points: np.ndarray) -> np.ndarray:
        return np.asarray((points - centre) @ linear.T + centre + shift)

    return Condition(moved(condition.points), condition.on, moved(condition.triangles))
