"""Show each augmentation on the same crops, before and after."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from jaxtyping import UInt8

from garden_models.disentanglement.training.augmentations.augment import augment
from garden_models.disentanglement.training.augmentations.config import (
    NAMES,
    Augmentations,
    without,
)
from garden_models.disentanglement.training.crop import cut, is_target, turned
from garden_models.disentanglement.training.pair import Condition, LabelledCloud
from garden_models.disentanglement.training.pairs_config import CropConfig
from garden_models.disentanglement.training.picture import MESH_RGB, by_label, cloud_picture
from garden_models.disentanglement.training.scenes.furnish import furnish

SHOWN = 8000


@dataclass(frozen=True)
class GalleryRow:
    """One crop: its shape, and its pictures by what was done to it."""

    shape: str
    pictures: dict[str, UInt8[np.ndarray, "s s 3"]]


def augmentation_gallery(crops: int, config: Augmentations, seed: int = 0) -> list[GalleryRow]:
    """Return pictures of crops as they are, with one augmentation each, and with all."""
    rows: list[GalleryRow] = []
    room_number = seed
    while len(rows) < crops:
        room = furnish("train", room_number)
        room_number += 1
        triangles = turned(room, 0.3)
        rng = np.random.default_rng((5, room_number))
        settings = CropConfig(pool=SHOWN)
        targets = [k for k in range(len(room.instances)) if is_target(room, k, settings)]
        for index in rng.permutation(targets)[:2]:
            drawn = cut(triangles, int(index), rng, settings)
            if drawn is not None and len(rows) < crops:
                rows.append(GalleryRow(room.instances[index].shape.name, _row(*drawn, config)))
    return rows


def _row(
    cloud: LabelledCloud, condition: Condition, config: Augmentations
) -> dict[str, UInt8[np.ndarray, "s s 3"]]:
    box = np.stack([cloud.points.min(axis=0), cloud.points.max(axis=0)])
    pictures = {"before": _picture(cloud, condition, box)}
    for name in NAMES:
        only = without(config, *(other for other in NAMES if other != name))
        # Half of the calls leave thin parts alone: show the other half.
        only = _always_thin(only)
        after = augment(cloud, condition, np.random.default_rng(1), only)
        pictures[name.replace("_", " ")] = _picture(*after, box)
    after = augment(cloud, condition, np.random.default_rng(1), config)
    return pictures | {"all": _picture(*after, box)}


def _always_thin(config: Augmentations) -> Augmentations:
    thin = dataclasses.replace(config.thin_parts, probability=1.0)
    return dataclasses.replace(config, thin_parts=thin, each=1.0)


def _picture(
    cloud: LabelledCloud, condition: Condition, box: np.ndarray
) -> UInt8[np.ndarray, "s s 3"]:
    points = np.concatenate([cloud.points, condition.points])
    mesh = np.tile(np.array(MESH_RGB, np.uint8), (len(condition.points), 1))
    return cloud_picture(points, np.concatenate([by_label(cloud.label), mesh]), box)
