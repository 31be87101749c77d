"""Find the dominant planes of a point cloud with normals (sequential RANSAC)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

Points = Float[np.ndarray, "n 3"]

NORMAL_TOLERANCE = np.cos(np.radians(35))
"""Points whose own normal differs by more than 35 degrees are not on the plane; normals
from stereo are noisy, so this only keeps the rims of crossing surfaces out."""


@dataclass(frozen=True)
class Plane:
    """The plane ``normal . x = offset`` (unit normal), and how well its points fix it.

    ``inliers`` index into the points it was found in; ``share`` is their weight of all
    points' weight. ``extent`` holds the points' standard deviations along the in-plane
    directions ``spread`` (2x3, longer first), ``thickness`` the one along the normal.
    """

    normal: Float[np.ndarray, "3"]
    offset: float
    centre: Float[np.ndarray, "3"]
    inliers: Int[np.ndarray, " m"]
    share: float
    spread: Float[np.ndarray, "2 3"]
    extent: Float[np.ndarray, "2"]
    thickness: float

    def heights(self, points: Points) -> Float[np.ndarray, " n"]:
        """Return the signed distances of points to the plane."""
        return points @ self.normal - self.offset


def fit_plane(
    points: Points, weights: Float[np.ndarray, " n"], inliers: Int[np.ndarray, " m"]
) -> Plane:
    """Return the weighted least-squares plane of ``points[inliers]`` (three at least)."""
    chosen, weight = points[inliers], weights[inliers]
    centre = weight @ chosen / weight.sum()
    centred = chosen - centre
    covariance = (centred * weight[:, None]).T @ centred / weight.sum()
    values, vectors = np.linalg.eigh(covariance)
    deviations = np.sqrt(np.maximum(values, 0))
    normal = vectors[:, 0]
    return Plane(
        normal,
        float(normal @ centre),
        centre,
        inliers,
        float(weight.sum() / weights.sum()),
        vectors[:, [2, 1]].T,
        deviations[[2, 1]],
        float(deviations[0]),
    )


def local_normals(points: Points, neighbours: int = 16) -> Points:
    """Return unit normals (sign undefined) of the planes through each point's neighbours."""
    _, index = cKDTree(points).query(points, k=min(neighbours, len(points)))
    local = points[index] - points[index].mean(1, keepdims=True)
    return np.linalg.eigh(np.einsum("nki,nkj->nij", local, local))[1][:, :, 0]


def find_planes(
    points: Points,
    normals: Points,
    tolerance: float,
    *,
    weights: Float[np.ndarray, " n"] | None = None,
    max_planes: int = 8,
    min_share: float = 0.03,
    trials: int = 400,
    seed: int = 0,
) -> list[Plane]:
    """Return dominant planes, the heaviest first; each takes its points away.

    A point belongs to a plane if it lies within ``tolerance`` (unit of the points) and its
    normal agrees. Every trial plane goes through a point along its own normal; the best is
    refined on its inliers until they stay. Deterministic for a ``seed``.
    """
    weights = np.ones(len(points)) if weights is None else weights
    total = weights.sum()
    rng = np.random.default_rng(seed)
    free = np.arange(len(points))
    found: list[Plane] = []
    while len(found) < max_planes and len(free) >= 3:
        p, n, w = points[free], normals[free], weights[free]
        seeds = rng.choice(len(free), size=min(trials, len(free)), replace=False)
        # Trials are compared on a sample; the winner is then refined on all points.
        sample = rng.choice(len(free), size=min(4000, len(free)), replace=False)
        distance = np.abs(p[sample] @ n[seeds].T - np.einsum("si,si->s", p[seeds], n[seeds]))
        agree = np.abs(n[sample] @ n[seeds].T) > NORMAL_TOLERANCE
        votes = w[sample] @ (agree * np.clip(2 - distance / tolerance, 0, 1))
        best = seeds[int(np.argmax(votes))]
        normal, offset = n[best], float(p[best] @ n[best])
        inliers = np.zeros(0, dtype=int)
        for step in range(12):
            # The first refits reach further, for the seed's own normal is noisy.
            reach = tolerance * max(1.0, 2.0 - step / 3)
            close = np.abs(p @ normal - offset) < reach
            inside = np.flatnonzero(close & (np.abs(n @ normal) > NORMAL_TOLERANCE))
            if len(inside) < 3 or (reach == tolerance and np.array_equal(inside, inliers)):
                break
            inliers = inside
            plane = fit_plane(p, w, inliers)
            normal, offset = plane.normal, plane.offset
        if len(inliers) < 3:
            break
        plane = fit_plane(points, weights, free[inliers])
        if plane.share < min_share:
            break
        found.append(plane)
        free = np.delete(free, inliers)
        if weights[free].sum() < min_share * total:
            break
    return found
