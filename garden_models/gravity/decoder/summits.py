"""Find the directions that surfaces and lines of a scene agree on: what may be vertical."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from garden_models.geometry.direction import hemisphere, least_axis
from garden_models.gravity.decoder.evidence import ViewEvidence

Axes = Float[np.ndarray, "k 3"]

GRID = 800
MOST_NORMALS, MOST_LINES = 1500, 800
FROM_NORMALS, FROM_LINES = 3, 3
NORMAL_KERNEL, LINE_KERNEL = np.radians(6.0), np.radians(2.5)
EXPLAINED_NORMAL, EXPLAINED_LINE = np.radians(15.0), np.radians(4.0)
SAME = np.cos(np.radians(6.0))
FEWEST = 12


def summits(evidence: ViewEvidence) -> Axes:
    """Return axes (signs undefined) along normals, along lines, and along walls' common line.

    They are looked for on a grid that is fixed to the reference camera, so that another world
    gives the same ones.
    """
    rotation = evidence.rotation[evidence.reference]
    found = _normal_axes(evidence, rotation)
    if len(found) > 1:
        across = np.cross(found[0], found[1])
        if np.linalg.norm(across) > 0.5:
            found.append(across / np.linalg.norm(across))
    found += _line_axes(evidence, rotation)
    distinct: list[np.ndarray] = []
    for axis in found:
        if all(abs(axis @ other) < SAME for other in distinct):
            distinct.append(axis)
    return np.array(distinct).reshape(-1, 3) @ rotation


def _normal_axes(evidence: ViewEvidence, rotation: np.ndarray) -> list[np.ndarray]:
    normals = _thinned(evidence.normal[evidence.normal_weight > 0], MOST_NORMALS)
    normals = normals @ rotation.T
    grid = hemisphere(GRID)
    axes: list[np.ndarray] = []
    while len(axes) < FROM_NORMALS and len(normals) >= FEWEST:
        density = np.exp((np.abs(grid @ normals.T) - 1) / NORMAL_KERNEL**2).sum(axis=1)
        axis = grid[int(np.argmax(density))]
        for _ in range(4):
            along = normals @ axis
            pull = np.sign(along) * np.exp((np.abs(along) - 1) / NORMAL_KERNEL**2)
            axis = pull @ normals
            axis = axis / max(float(np.linalg.norm(axis)), 1e-12)
        axes.append(axis)
        normals = normals[np.abs(normals @ axis) < np.cos(EXPLAINED_NORMAL)]
    return axes


def _line_axes(evidence: ViewEvidence, rotation: np.ndarray) -> list[np.ndarray]:
    known = evidence.line_weight > 0
    order = np.argsort(-evidence.line_weight[known], kind="stable")[:MOST_LINES]
    lines, weight = evidence.line[known][order] @ rotation.T, evidence.line_weight[known][order]
    grid = hemisphere(GRID)
    axes: list[np.ndarray] = []
    while len(axes) < FROM_LINES and len(lines) >= FEWEST:
        votes = np.exp(-0.5 * (grid @ lines.T / LINE_KERNEL) ** 2) @ weight
        axis = grid[int(np.argmax(votes))]
        for _ in range(4):
            near = weight * np.exp(-0.5 * (lines @ axis / LINE_KERNEL) ** 2)
            axis = least_axis((lines * near[:, None]).T @ lines + 1e-9 * np.eye(3))[0]
        axes.append(axis)
        left = np.abs(lines @ axis) > EXPLAINED_LINE
        if left.all():
            break
        lines, weight = lines[left], weight[left]
    return axes


def _thinned(rows: np.ndarray, most: int) -> np.ndarray:
    return rows[np.linspace(0, len(rows) - 1, min(len(rows), most)).round().astype(int)]
