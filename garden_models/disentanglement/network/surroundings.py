"""Describe the surroundings of context points: local shape, layers of level surface, clusters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

FINE, COARSE = 12, 48
"""Neighbours that show the local shape."""
LINK = 2.2
"""Points nearer than this many median spacings hang together."""
LAYER = 0.02
"""Half the thickness of a level layer, of the object's size."""
LEVEL = 0.8
"""Least |y| of a level surface's normal."""
LAYER_SHARE = 0.06
"""Share of the level points that makes a layer."""


@dataclass(frozen=True)
class Local:
    """Principal axes of the nearest points: normal (sign free), the two smaller deviations
    relative to the largest, the centre's offset and the neighbourhood's radius (in the input's
    unit).
    """

    normal: Float[np.ndarray, "n 3"]
    flatness: Float[np.ndarray, "n 2"]
    offset: Float[np.ndarray, "n 3"]
    radius: Float[np.ndarray, " n"]


def neighbours(points: Float[np.ndarray, "n 3"]) -> Int[np.ndarray, "n k"]:
    """Return the ``COARSE`` nearest points of each, itself first."""
    _, index = cKDTree(points).query(points, k=min(COARSE, len(points)))
    return np.asarray(index)


def local_shape(points: Float[np.ndarray, "n 3"], near: Int[np.ndarray, "n k"]) -> Local:
    """Return the shape of each point's surroundings."""
    around = points[near]
    centre = around.mean(axis=1)
    centred = around - centre[:, None]
    spread = np.matmul(centred.transpose(0, 2, 1), centred) / near.shape[1]
    value, vector = np.linalg.eigh(spread)
    deviation = np.sqrt(np.maximum(value, 0))
    flatness = deviation[:, :2] / np.maximum(deviation[:, 2:], 1e-9)
    radius = np.linalg.norm(around[:, -1] - points, axis=1)
    offset = (centre - points) / np.maximum(radius, 1e-9)[:, None]
    return Local(vector[:, :, 0], flatness, offset, radius)


def layer_density(
    height: Float[np.ndarray, " n"], level: Bool[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    """Return, for each height, the share of level points within ``LAYER`` of it."""
    heights = np.sort(height[level])
    low, high = np.searchsorted(heights, [height - LAYER, height + LAYER])
    return np.asarray((high - low) / max(len(heights), 1))


def strongest_layer(
    height: Float[np.ndarray, " n"], density: Float[np.ndarray, " n"], level: Bool[np.ndarray, " n"]
) -> float:
    """Return the height around which most level points lie (0 where there are none)."""
    if not level.any():
        return 0.0
    candidates = np.flatnonzero(level)
    most = candidates[density[candidates] >= density[candidates].max() - 1e-12]
    return float(np.median(height[most]))


def clusters(
    points: Float[np.ndarray, "n 3"], left_out: Bool[np.ndarray, " n"], reach: float
) -> Int[np.ndarray, " n"]:
    """Return each point's cluster (-1 for those left out): points linked within ``reach``."""
    label = np.full(len(points), -1)
    kept = np.flatnonzero(~left_out)
    if not len(kept):
        return label
    pairs = cKDTree(points[kept]).query_pairs(reach, output_type="ndarray")
    graph = coo_array(
        (np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(kept), len(kept))
    )
    label[kept] = connected_components(graph, directed=False)[1]
    return label


def cluster_features(
    points: Float[np.ndarray, "n 3"], cluster: Int[np.ndarray, " n"], near: Bool[np.ndarray, " n"]
) -> Float[np.ndarray, "n 9"]:
    """Return what each point's cluster is like: its share of the points, the share of it that
    lies near the condition and the share of what lies near that is its own, its centre and
    extent. Zero for points without a cluster.
    """
    features = np.zeros((len(points), 9))
    member = np.flatnonzero(cluster >= 0)
    if not len(member):
        return features
    which = cluster[member]
    count = np.bincount(which)
    close = np.bincount(which, near[member].astype(float), len(count))
    low = np.full((len(count), 3), np.inf)
    high = np.full((len(count), 3), -np.inf)
    np.minimum.at(low, which, points[member])
    np.maximum.at(high, which, points[member])
    summary = np.column_stack(
        [
            count / len(points),
            close / count,
            close / max(float(near.sum()), 1.0),
            np.clip((low + high) / 2, -2, 2),
            np.clip(high - low, 0, 4),
        ]
    )
    features[member] = summary[which]
    return features
