"""Describe one shard of pairs as the network reads it. A minute, CPU."""

from __future__ import annotations

from garden_models.disentanglement.network.config import NetworkConfig
from garden_models.disentanglement.training.described import DescribedShard
from garden_models.disentanglement.training.pair import PairShard
from garden_models.progress import Progress, silent
from tasks.step import step


@step(version=1, packages=("numpy", "scipy"), isolated=True, time_limit_s=7200, memory_limit_gb=6)
def describe_training_pairs(
    shard: PairShard, network: NetworkConfig, progress: Progress = silent
) -> DescribedShard:
    """Return the features, tokens and conditions of the shard's pairs."""
    from garden_models.disentanglement.training.described import describe_shard

    return describe_shard(shard, network, progress)
