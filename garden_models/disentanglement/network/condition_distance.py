"""Measure points against the condition: distance, side and normal of the nearest triangle."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

from garden_models.disentanglement.training.pair import Condition
from garden_models.disentanglement.triangles import (
    closest_on_triangles,
    normals,
    sample_triangles,
)

SAMPLES = 12_288
CANDIDATES = 6
"""Triangles compared for each point: those of its nearest samples."""
ALIKE = 1e-4
"""Squared distances that differ by less than this share are to one edge."""


@dataclass(frozen=True)
class ToCondition:
    """How points lie to the mesh.

    ``distance`` in metres; ``towards`` the unit vector from the nearest surface point (zero
    on the surface); ``normal`` that of its triangle.
    """

    distance: Float[np.ndarray, " n"]
    towards: Float[np.ndarray, "n 3"]
    normal: Float[np.ndarray, "n 3"]


@dataclass(frozen=True)
class Surface:
    """A condition's triangles, ready to be asked for the nearest one."""

    condition: Condition

    @cached_property
    def _samples(self) -> tuple[cKDTree, Int[np.ndarray, " s"]]:
        """Dense samples, the centre of every triangle among them, and their triangles."""
        triangles = self.condition.triangles
        points, on = sample_triangles(triangles, SAMPLES, np.random.default_rng(0))
        every = np.arange(len(triangles))
        return (
            cKDTree(np.concatenate([points, triangles.mean(axis=1)])),
            np.concatenate([on, every]),
        )

    @cached_property
    def _normals(self) -> Float[np.ndarray, "t 3"]:
        return normals(self.condition.triangles)

    def ask(self, points: Float[np.ndarray, "n 3"]) -> ToCondition:
        """Return how each point lies to the nearest of the triangles.

        Nearest to an edge, the normal is the mean of the faces'.
        """
        triangles = self.condition.triangles
        tree, on = self._samples
        _, index = tree.query(points, k=CANDIDATES)
        candidates = on[index]
        best = np.full(len(points), np.finfo(float).max)
        nearest, normal = np.zeros((len(points), 3)), np.zeros((len(points), 3))
        for k in range(CANDIDATES):
            # Neighbouring samples often lie on one triangle: ask it once.
            new = np.flatnonzero((candidates[:, k : k + 1] != candidates[:, :k]).all(axis=1))
            which = candidates[new, k]
            foot = closest_on_triangles(points[new], triangles[which])
            squared = np.square(points[new] - foot).sum(axis=1)
            slack = ALIKE * best[new]
            better, alike = squared < best[new] - slack, np.abs(squared - best[new]) <= slack
            at = new[better]
            best[at], nearest[at] = squared[better], foot[better]
            normal[at] = self._normals[which[better]]
            normal[new[alike]] += self._normals[which[alike]]
        distance = np.sqrt(best)
        towards = (points - nearest) / np.maximum(distance, 1e-9)[:, None]
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        return ToCondition(distance, towards, normal / np.maximum(length, 1e-9))


def to_condition(points: Float[np.ndarray, "n 3"], condition: Condition) -> ToCondition:
    """Return how each point lies to the nearest of the condition's triangles."""
    return Surface(condition).ask(np.asarray(points, np.float64))
