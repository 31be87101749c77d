"""Label pairs with a network, from the context that each pair brings."""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float

from garden_models.disentanglement.network.model import PointClassifier
from garden_models.disentanglement.training.described import DescribedShard
from garden_models.disentanglement.training.pair import CONTEXT_POINTS

BATCH = 16


def probabilities(
    model: PointClassifier, data: DescribedShard, points: int | None = None
) -> Float[np.ndarray, "p n"]:
    """Return each point's probability of being its pair's object's."""
    found = []
    model.eval()
    with torch.inference_mode():
        for start in range(0, len(data), BATCH):
            rows = slice(start, start + BATCH)
            features = torch.from_numpy(data.features[rows].astype(np.float32))
            tokens, places = model.tokens(
                features[:, :CONTEXT_POINTS],
                torch.from_numpy(data.token[rows].astype(np.int64)),
                torch.from_numpy(data.assigned[rows].astype(np.int64)),
                torch.from_numpy(data.condition[rows].astype(np.float32)),
            )
            found.append(model(features[:, :points], tokens, places).sigmoid().numpy())
    return np.concatenate(found)
