"""Lay the condition onto the points that a first pass took for the object's.

A mesh that is placed or scaled wrongly gives misleading distances. Where the points that were
taken show its true place, scale along its axes and yaw, a second pass sees better ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

from garden_models.disentanglement.training.pair import Condition

LEAST_POINTS = 40
MOST_POINTS = 640
ROUNDS = 16
MOST_SCALE = 2.0
MOST_YAW_DEG = 30.0
KEPT = 0.9
"""Share of the taken points, the nearest ones, that a round goes by."""
CLOSE = 0.03
"""Of the mesh's extent: what counts as lying on the mesh."""
GAIN = 0.03
"""By how much more of the points must lie on the mesh for it to be moved."""


@dataclass(frozen=True)
class _Pose:
    """Scale along the mesh's axes, then yaw (radians), then shift; all about its centre."""

    scale: Float[np.ndarray, "3"]
    yaw: float
    shift: Float[np.ndarray, "3"]

    def matrix(self) -> Float[np.ndarray, "3 3"]:
        """Return scale and yaw as one linear map."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return np.asarray(np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) * self.scale)


def realigned(taken: Float[np.ndarray, "n 3"], condition: Condition) -> Condition | None:
    """Return the condition laid onto the object's points (metres).

    None where there are too few of them, or it fits no better than it did.
    """
    if len(taken) < LEAST_POINTS:
        return None
    taken = taken[:: -(-len(taken) // MOST_POINTS)]
    size, centre = condition.size, condition.box.mean(axis=0)
    local = (condition.points - centre) / size
    asked = (taken - centre) / size
    before = _on_mesh(asked, local)
    best, most = None, before + GAIN
    for yaw in np.radians([0.0, -14.0, 14.0]):
        pose = _fit(asked, local, _start(asked, local, float(yaw)))
        share = _on_mesh(asked, local @ pose.matrix().T + pose.shift)
        if share > most:
            best, most = pose, share
    if best is None:
        return None
    matrix, shift = best.matrix(), centre + best.shift * size

    def moved(points: np.ndarray) -> np.ndarray:
        return np.asarray((points - centre) @ matrix.T + shift)

    return Condition(moved(condition.points), condition.on, moved(condition.triangles))


def _on_mesh(asked: np.ndarray, mesh: np.ndarray) -> float:
    """Return the share of points that lie on the mesh, times that of the mesh they lie on."""
    there, _ = cKDTree(mesh).query(asked)
    back, _ = cKDTree(asked).query(mesh)
    return float(np.sqrt((there < CLOSE).mean() * (back < 2 * CLOSE).mean()))


def _start(asked: np.ndarray, mesh: np.ndarray, yaw: float) -> _Pose:
    """Return the pose that makes the extents agree."""
    c, s = np.cos(yaw), np.sin(yaw)
    back = asked @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    low, high = np.quantile(back, [0.02, 0.98], axis=0)
    mesh_low, mesh_high = np.quantile(mesh, [0.02, 0.98], axis=0)
    scale = np.clip(
        (high - low) / np.maximum(mesh_high - mesh_low, 1e-6), 1 / MOST_SCALE, MOST_SCALE
    )
    pose = _Pose(scale, yaw, np.zeros(3))
    middle = (low + high) / 2 @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T
    return _Pose(scale, yaw, middle - (mesh_low + mesh_high) / 2 @ pose.matrix().T)


def _fit(asked: np.ndarray, mesh: np.ndarray, pose: _Pose) -> _Pose:
    """Return the pose after rounds of matching each point to the nearest mesh sample."""
    for _ in range(ROUNDS):
        distance, index = cKDTree(mesh @ pose.matrix().T + pose.shift).query(asked)
        kept = distance <= np.quantile(distance, KEPT)
        source, target = mesh[index[kept]], asked[kept]
        yaw = _yaw(source * pose.scale, target)
        c, s = np.cos(yaw), np.sin(yaw)
        back = target @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        source_mean, back_mean = source.mean(axis=0), back.mean(axis=0)
        spread = np.square(source - source_mean).sum(axis=0)
        along = ((source - source_mean) * (back - back_mean)).sum(axis=0)
        scale = np.where(spread > 1e-6 * len(source), along / np.maximum(spread, 1e-12), pose.scale)
        scale = np.clip(scale, 1 / MOST_SCALE, MOST_SCALE)
        turned = _Pose(scale, yaw, np.zeros(3))
        pose = _Pose(scale, yaw, target.mean(axis=0) - source_mean @ turned.matrix().T)
    return pose


def _yaw(source: np.ndarray, target: np.ndarray) -> float:
    """Return the turn about y that takes one set of places nearest to the other."""
    a, b = source - source.mean(axis=0), target - target.mean(axis=0)
    across = float((a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2]).sum())
    along = float((a[:, 0] * b[:, 0] + a[:, 2] * b[:, 2]).sum())
    limit = np.radians(MOST_YAW_DEG)
    return float(np.clip(np.arctan2(across, along), -limit, limit))
