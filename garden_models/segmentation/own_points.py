"""Collect an object's own fused points around the nodes that were found to be its."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool
from scipy.spatial import cKDTree

from garden_models.scene import PointCloud


def points_near(cloud: PointCloud, nodes: PointCloud, own: Bool[np.ndarray, " n"]) -> PointCloud:
    """Return the points of ``cloud`` whose nearest node is one of the ``own``.

    Nodes were thinned where there were many; points further from all nodes than the
    thinned nodes are from each other are no target.
    """
    if not own.any():
        return cloud.subset(np.zeros(0, np.int64))
    reach = 3 * float(np.median(nodes.spacing))
    low, high = nodes.xyz[own].min(0) - reach, nodes.xyz[own].max(0) + reach
    near = np.flatnonzero(((cloud.xyz >= low) & (cloud.xyz <= high)).all(1))
    distance, index = cKDTree(nodes.xyz).query(
        cloud.xyz[near], distance_upper_bound=reach, workers=2
    )
    hit = np.isfinite(distance)
    hit[hit] = own[index[hit]]
    return cloud.subset(near[hit])
