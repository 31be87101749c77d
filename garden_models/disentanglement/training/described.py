"""Describe whole shards of pairs for the network, once, in half precision."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Float, Int

from garden_models.disentanglement.network.config import NetworkConfig
from garden_models.disentanglement.network.describe import describe_context, describe_points
from garden_models.disentanglement.training.pair import CONTEXT_POINTS, PairShard
from garden_models.progress import Progress, silent


@dataclass(frozen=True)
class DescribedShard:
    """What the network reads of ``p`` pairs; the first ``CONTEXT_POINTS`` are context."""

    SCHEMA: ClassVar[str] = "garden.DescribedShard/1"
    features: Float[np.ndarray, "p n f"]
    label: Bool[np.ndarray, "p n"]
    token: Int[np.ndarray, "p m"]
    assigned: Int[np.ndarray, "p c"]
    condition: Float[np.ndarray, "p k g"]

    def __len__(self) -> int:
        return len(self.features)


def describe_shard(
    shard: PairShard, config: NetworkConfig, progress: Progress = silent
) -> DescribedShard:
    """Return a shard as the network reads it."""
    features, token, assigned, conditions = [], [], [], []
    for k in range(len(shard)):
        progress(k / len(shard), f"pair {k} of {len(shard)}")
        pair = shard.pair(k)
        points = pair.cloud.points.astype(np.float64)
        context = describe_context(points[:CONTEXT_POINTS], pair.condition, config)
        rest = describe_points(points[CONTEXT_POINTS:], context)
        features.append(np.concatenate([context.features, rest]).astype(np.float16))
        token.append(context.token.astype(np.int16))
        assigned.append(context.assigned.astype(np.int16))
        conditions.append(context.condition.astype(np.float16))
    return DescribedShard(
        np.stack(features), shard.label, np.stack(token), np.stack(assigned), np.stack(conditions)
    )


def joined(shards: tuple[DescribedShard, ...]) -> DescribedShard:
    """Return shards as one."""
    return DescribedShard(
        np.concatenate([s.features for s in shards]),
        np.concatenate([s.label for s in shards]),
        np.concatenate([s.token for s in shards]),
        np.concatenate([s.assigned for s in shards]),
        np.concatenate([s.condition for s in shards]),
    )
