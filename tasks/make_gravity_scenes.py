"""Make one shard of procedural scenes for the gravity decoder. A minute, CPU."""

from __future__ import annotations

from garden_models.gravity.training.shard import EvidenceShard
from garden_models.gravity.training.splits import Split
from garden_models.progress import Progress, silent
from tasks.step import step


@step(
    version=1,
    packages=("numpy", "opencv-python-headless"),
    isolated=True,
    time_limit_s=7200,
    memory_limit_gb=4,
)
def make_gravity_scenes(
    split: Split, first: int, scenes: int, progress: Progress = silent
) -> EvidenceShard:
    """Return the evidence of scenes ``first`` and following of a split, with true gravity."""
    from garden_models.gravity.training.shard import make_shard

    return make_shard(split, first, scenes, progress)
