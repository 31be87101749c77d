"""Make photographed test scenes of a condition, with their true gravity."""

from __future__ import annotations

import dataclasses

import numpy as np

from garden_models.gravity.evaluation.conditions import Condition
from garden_models.gravity.training.scenes.observe import photographed
from garden_models.gravity.training.scenes.photograph import PHOTO_SIZE, photograph
from garden_models.gravity.training.splits import Split, scene_generator
from garden_models.metrics.gravity import GravityTruth


def procedural_truth(split: Split, number: int, condition: Condition) -> GravityTruth:
    """Return a split's scene as a reconstruction, and the direction down in its world."""
    rng = scene_generator(split, number)
    turned = condition.cameras_off_deg
    shot = photographed(
        rng,
        condition.room,
        condition.photographer,
        PHOTO_SIZE,
        None if turned is None else float(np.radians(turned)),
    )
    made = photograph(shot, rng)
    if turned == 0:
        made = dataclasses.replace(made, cameras_source="known")
    return GravityTruth(f"{split} {number}", made, shot.down_world)
