"""Make one shard of object-scene pairs for the point classifier. A minute, CPU.

Shards are keyed by what they hold: another training of the same data makes none again.
"""

from __future__ import annotations

from garden_models.disentanglement.training.pair import PairShard
from garden_models.disentanglement.training.pairs_config import PairsConfig
from garden_models.disentanglement.training.splits import Split
from garden_models.progress import Progress, silent
from tasks.step import step


@step(version=1, packages=("numpy", "scipy"), isolated=True, time_limit_s=7200, memory_limit_gb=6)
def make_training_pairs(
    split: Split,
    first_room: int,
    rooms: int,
    config: PairsConfig,
    packages: bool,
    progress: Progress = silent,
) -> PairShard:
    """Return the pairs of rooms ``first_room`` and following of a split."""
    from garden_models.disentanglement.training.pairs import make_shard
    from garden_models.disentanglement.training.scenes.furnish import Meshes
    from garden_models.disentanglement.training.shapes.package_meshes import package_shapes

    meshes = Meshes(package_shapes(split)) if packages else Meshes()
    return make_shard(split, first_room, rooms, config, meshes, progress)
