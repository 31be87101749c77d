"""Label pairs with a network, from the context that each pair brings."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from garden_models.disentanglement.network.model import PointClassifier
from garden_models.disentanglement.network.predict import answer
from garden_models.disentanglement.training.pair import CONTEXT_POINTS, PairShard
from garden_models.progress import Progress, silent


def probabilities(
    model: PointClassifier, shard: PairShard, progress: Progress = silent
) -> Float[np.ndarray, "p n"]:
    """Return each point's probability of being its pair's object's."""
    found = []
    for k in range(len(shard)):
        progress(k / len(shard), f"pair {k} of {len(shard)}")
        pair = shard.pair(k)
        points = pair.cloud.points.astype(np.float64)
        found.append(answer(model, points[:CONTEXT_POINTS], points, pair.condition))
    return np.stack(found)
