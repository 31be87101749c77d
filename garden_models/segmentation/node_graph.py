"""Join neighbouring points to a graph whose weak edges are where one thing ends."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

from garden_models.scene import PointCloud

NEIGHBOURS = 10
SURROUNDINGS = 24
THINNING = 6
"""Whether a point lies in a crease is told by its nearest ``SURROUNDINGS`` of every
``THINNING``-th point, some six spacings around: stereo rounds creases off.
"""
SHADE = 0.5
"""Weight of lightness against hue in a colour difference: light and shadow change the first
across one thing, seldom the second.
"""
BUSY = 2.0
"""A colour edge counts from this many times the mean difference of its neighbours on."""
SMOOTHING_PASSES = 2
ALIKE_POWER = 8
"""Neighbours 30 degrees apart smooth each other by a third, 60 degrees apart not at all."""


@dataclass(frozen=True)
class NodeGraph:
    """Points (GV) with smoothed normals, and edges with weights in 0..1.

    ``length`` is each edge's length in units of its points' spacing.
    """

    cloud: PointCloud
    edges: Int[np.ndarray, "e 2"]
    length: Float[np.ndarray, " e"]
    weights: Float[np.ndarray, " e"]

    def components(self, keep: Bool[np.ndarray, " n"]) -> Int[np.ndarray, " n"]:
        """Number the connected parts of the kept points from 0; others get -1."""
        inside = keep[self.edges].all(1)
        i, j = self.edges[inside].T
        count = len(self.cloud)
        graph = sparse.coo_matrix((np.ones(len(i), np.int8), (i, j)), shape=(count, count))
        _, labels = csgraph.connected_components(graph, directed=False)
        out = np.full(count, -1)
        if keep.any():
            out[keep] = np.unique(labels[keep], return_inverse=True)[1].ravel()
        return out


def node_graph(
    cloud: PointCloud, *, reach: float, colour_sigma: float, crease_deg: float
) -> NodeGraph:
    """Join each point to its nearest neighbours within ``reach`` spacings.

    An edge is weaker the longer it is, the more its colours differ (``colour_sigma``: CIE
    Lab units; lightness counts half) and the deeper the crease that its points lie in
    (``crease_deg``: how steeply the surface rises around them): where two things touch,
    the surface is concave (Stein et al. 2014, "Object partitioning using local convexity").
    Normals must point out of the surfaces.
    """
    tree = cKDTree(cloud.xyz)
    count = min(NEIGHBOURS + 1, len(cloud))
    distance, index = tree.query(cloud.xyz, count, workers=2)
    distance, index = distance.reshape(len(cloud), -1), index.reshape(len(cloud), -1)
    normal = _smoothed(cloud.normal, index)
    # A crease that bends by an angle rises by its half on both sides, 2 / pi of it on average.
    hollow = _hollowness(cloud.xyz, normal) / (2 / np.pi * np.sin(np.radians(crease_deg) / 2))
    first = np.repeat(np.arange(len(cloud)), index.shape[1])
    second, flat = index.ravel(), distance.ravel()
    limit = reach * np.maximum(cloud.spacing[first], cloud.spacing[second])
    keep = (first != second) & (flat <= limit)
    low, high = np.minimum(first, second)[keep], np.maximum(first, second)[keep]
    _, unique = np.unique(low * len(cloud) + high, return_index=True)
    edges = np.stack([low[unique], high[unique]], 1)
    length = flat[keep][unique] / np.maximum(cloud.spacing[edges].mean(1), 1e-12)

    lab = lab_colours(cloud.rgb) * [SHADE, 1.0, 1.0]
    colour = np.linalg.norm(lab[edges[:, 0]] - lab[edges[:, 1]], axis=1)
    # On a busy texture, colours differ everywhere and say nothing of where it ends.
    degree = np.maximum(np.bincount(edges.ravel(), minlength=len(cloud)), 1)
    busy = np.bincount(edges.ravel(), np.repeat(colour, 2), len(cloud)) / degree
    sigma = np.hypot(colour_sigma, BUSY * busy[edges].min(1))
    weights = np.exp(-((length / reach) ** 2) - (colour / sigma) ** 2 - hollow[edges].max(1) ** 2)
    smooth = PointCloud(cloud.xyz, cloud.rgb, normal, cloud.spacing, cloud.confidence)
    return NodeGraph(smooth, edges, length, weights)


def lab_colours(rgb: UInt8[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
    """Return CIE Lab colours (L 0..100, a and b about -100..100)."""
    image = np.ascontiguousarray(rgb.reshape(1, -1, 3)).astype(np.float32) / 255
    return cv2.cvtColor(image, cv2.COLOR_RGB2LAB).reshape(rgb.shape)


def _hollowness(
    xyz: Float[np.ndarray, "n 3"], normal: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, " n"]:
    """Return the mean rise of the surface around each point along its normal, relative to
    the neighbours' distance: 0 where it is flat or bulges, up to 1 in a pit.
    """
    few = np.random.default_rng(0).permutation(len(xyz))[: max(len(xyz) // THINNING, 1)]
    count = min(SURROUNDINGS, len(few))
    distance, index = cKDTree(xyz[few]).query(xyz, count, workers=2)
    around = xyz[few[index.reshape(len(xyz), -1)]] - xyz[:, None]
    rise = (around * normal[:, None]).sum(-1).mean(1)
    return (rise / np.maximum(distance.reshape(len(xyz), -1).mean(1), 1e-12)).clip(0)


def _smoothed(
    normal: Float[np.ndarray, "n 3"], index: Int[np.ndarray, "n k"]
) -> Float[np.ndarray, "n 3"]:
    """Average normals over neighbours that face about the same way, so that creases stay."""
    index = np.where(index < len(normal), index, np.arange(len(normal))[:, None])
    for _ in range(SMOOTHING_PASSES):
        near = normal[index]
        alike = np.clip((near * normal[:, None]).sum(-1), 0, 1) ** ALIKE_POWER
        mean = (near * alike[..., None]).sum(1)
        size = np.linalg.norm(mean, axis=1, keepdims=True)
        normal = np.where(size > 1e-6, mean / np.maximum(size, 1e-12), normal)
    return normal
