"""Make object-scene pairs: rooms, crops, augmentations; same numbers, same pairs."""

from __future__ import annotations

import numpy as np

from garden_models.disentanglement.training.augmentations.augment import augment
from garden_models.disentanglement.training.crop import RoomTriangles, cut, is_target, turned
from garden_models.disentanglement.training.pair import (
    CONTEXT_POINTS,
    LabelledCloud,
    Pair,
    PairShard,
    stacked,
)
from garden_models.disentanglement.training.pairs_config import PairsConfig
from garden_models.disentanglement.training.scenes.furnish import Meshes, furnish
from garden_models.disentanglement.training.scenes.room import Room
from garden_models.disentanglement.training.splits import SPLITS, Split
from garden_models.progress import Progress, silent


def make_shard(
    split: Split,
    first_room: int,
    rooms: int,
    config: PairsConfig = PairsConfig(),
    meshes: Meshes = Meshes(),
    progress: Progress = silent,
) -> PairShard:
    """Return the pairs of some of a split's rooms (those with these numbers)."""
    pairs: list[Pair] = []
    for k in range(rooms):
        progress(k / rooms, f"room {first_room + k}")
        room = furnish(split, first_room + k, meshes)
        pairs += pairs_of_room(room, (SPLITS.index(split), first_room + k), config)
    return stacked(pairs, split, config.augmented > 0)


def pairs_of_room(room: Room, seed: tuple[int, int], config: PairsConfig) -> list[Pair]:
    """Return up to ``pairs_a_room`` pairs, of different instances."""
    rng = np.random.default_rng((11, *seed))
    targets = [k for k in range(len(room.instances)) if is_target(room, k, config.crop)]
    chosen = rng.permutation(targets)[: config.pairs_a_room]
    triangles = turned(room, rng.uniform(0, 2 * np.pi))
    # A generator of its own for each pair: an ablation sees the same crops.
    found = [
        _pair(triangles, int(index), np.random.default_rng((13, *seed, int(index))), config)
        for index in chosen
    ]
    return [pair for pair in found if pair is not None]


def _pair(
    triangles: RoomTriangles, index: int, rng: np.random.Generator, config: PairsConfig
) -> Pair | None:
    drawn = cut(triangles, index, rng, config.crop)
    augmented = rng.random() < config.augmented
    if drawn is None:
        return None
    cloud, condition = drawn
    size = condition.size
    if augmented:
        cloud, condition = augment(cloud, condition, rng, config.augmentations)
    if len(cloud.points) < CONTEXT_POINTS or cloud.label.mean() < config.crop.least_positive / 2:
        return None
    cloud = _of_length(cloud, config.points, rng)
    instance = triangles.room.instances[index]
    return Pair(
        cloud, condition, instance.position[1], size, instance.shape.name, triangles.room.name
    )


def _of_length(cloud: LabelledCloud, count: int, rng: np.random.Generator) -> LabelledCloud:
    """Return ``count`` of the points in random order; some twice where there are too few."""
    order = rng.permutation(len(cloud.points))
    return cloud.subset(np.resize(order, count))
