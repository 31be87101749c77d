"""Compare triangle meshes: chamfer distance, F-score, volume.

Distances are relative to ``size``, the diagonal of the true mesh's bounding box.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import cKDTree


@dataclass(frozen=True)
class MeshComparison:
    """How a mesh differs from the true one; shares of the true mesh's size (diagonal).

    ``accuracy`` is the mean distance from the mesh to the truth, ``completeness`` that from
    the truth to the mesh, ``chamfer`` the mean of both. ``f_score`` (0..1) is the harmonic
    mean of the shares of samples within ``f_threshold`` in both directions.
    ``volume_ratio`` is the enclosed volume over the true one.
    """

    chamfer: float
    accuracy: float
    completeness: float
    f_score: float
    f_threshold: float
    volume_ratio: float
    size: float


def bounding_diagonal(vertices: Float[np.ndarray, "v 3"]) -> float:
    """Return the diagonal of the axis-parallel bounding box."""
    return float(np.linalg.norm(np.ptp(vertices, axis=0)))


def enclosed_volume(vertices: Float[np.ndarray, "v 3"], faces: Int[np.ndarray, "f 3"]) -> float:
    """Return the volume inside a closed mesh, positive if its faces look outward."""
    a, b, c = (vertices[faces[:, i]].astype(float) for i in range(3))
    return float(np.einsum("fi,fi->", a, np.cross(b, c)) / 6.0)


def sample_surface(
    vertices: Float[np.ndarray, "v 3"],
    faces: Int[np.ndarray, "f 3"],
    count: int,
    seed: int = 0,
) -> Float[np.ndarray, "n 3"]:
    """Return ``count`` points spread evenly by area. Raises ValueError without any area."""
    corners = np.asarray(vertices, float)[faces]
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    if not area.sum() > 0:
        raise ValueError("cannot sample a mesh without any area")
    rng = np.random.default_rng(seed)
    # Equal steps with one random offset: less noise than independent draws.
    steps = (np.arange(count) + rng.random()) / count
    face = np.searchsorted(np.cumsum(area) / area.sum(), steps)
    face = np.minimum(face, len(faces) - 1)
    root = np.sqrt(rng.random(count))[:, None]
    along = rng.random(count)[:, None]
    a, b, c = corners[face, 0], corners[face, 1], corners[face, 2]
    return (1 - root) * a + root * (1 - along) * b + root * along * c


def compare_meshes(
    vertices: Float[np.ndarray, "v 3"],
    faces: Int[np.ndarray, "f 3"],
    true_vertices: Float[np.ndarray, "w 3"],
    true_faces: Int[np.ndarray, "g 3"],
    *,
    samples: int = 30_000,
    f_threshold: float = 0.02,
    seed: int = 0,
) -> MeshComparison:
    """Compare two meshes given in one frame, in the same unit."""
    size = bounding_diagonal(true_vertices)
    ours = sample_surface(vertices, faces, samples, seed)
    true = sample_surface(true_vertices, true_faces, samples, seed + 1)
    to_true = cKDTree(true).query(ours)[0] / size
    to_ours = cKDTree(ours).query(true)[0] / size
    precision, recall = (to_true < f_threshold).mean(), (to_ours < f_threshold).mean()
    true_volume = enclosed_volume(true_vertices, true_faces)
    return MeshComparison(
        chamfer=float(0.5 * (to_true.mean() + to_ours.mean())),
        accuracy=float(to_true.mean()),
        completeness=float(to_ours.mean()),
        f_score=float(2 * precision * recall / max(precision + recall, 1e-12)),
        f_threshold=f_threshold,
        volume_ratio=enclosed_volume(vertices, faces) / true_volume if true_volume else np.nan,
        size=size,
    )
