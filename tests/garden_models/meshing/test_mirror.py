from __future__ import annotations

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from garden_models.meshing.mirror import (
    EMPTY,
    SURFACE,
    UNKNOWN,
    Look,
    find_mirror_plane,
    reflect,
)
from garden_models.metrics.mesh import sample_surface
from tests.garden_models.meshing.staged import block


def _half_seen(mesh: trimesh.Trimesh, seen_share_z: float) -> tuple[np.ndarray, Look]:
    """Points with small z are seen; beyond that nothing is known."""
    points = sample_surface(np.asarray(mesh.vertices), np.asarray(mesh.faces), 4000)
    limit = np.quantile(points[:, 2], seen_share_z)
    tree = cKDTree(points)
    seen = points[points[:, 2] <= limit]

    def look(places: np.ndarray) -> np.ndarray:
        near = np.isfinite(tree.query(places, distance_upper_bound=0.012)[0])
        state = np.where(near, SURFACE, EMPTY)
        return np.where(places[:, 2] > limit, UNKNOWN, state)

    return seen[:: len(seen) // 400], look


def test_reflection_is_its_own_inverse() -> None:
    rng = np.random.default_rng(0)
    points = rng.normal(size=(20, 3))
    normal = np.array([0.6, 0.0, 0.8])
    once = reflect(points, normal, 0.3)
    np.testing.assert_allclose(reflect(once, normal, 0.3), points)
    np.testing.assert_allclose(0.5 * (once + points) @ normal, 0.3)


def test_the_plane_of_a_turned_box_is_found() -> None:
    box = trimesh.creation.box([0.3, 0.1, 0.2])
    box.apply_transform(trimesh.transformations.rotation_matrix(0.35, [0, 1, 0]))
    seen, look = _half_seen(box, 0.75)
    plane = find_mirror_plane(seen, look)
    assert plane is not None and plane.score > 0.97
    axes = np.stack([[np.cos(0.35), 0, -np.sin(0.35)], [np.sin(0.35), 0, np.cos(0.35)]])
    assert np.abs(axes @ plane.normal).max() > np.cos(np.radians(3))
    assert abs(plane.offset) < 0.01


def test_a_block_with_a_tower_at_one_end_is_not_mirrored_end_to_end() -> None:
    shape = block()
    seen, look = _half_seen(shape, 1.0)
    plane = find_mirror_plane(seen, look)
    # Its knob stands off the middle, so it has no mirror plane at all.
    assert plane is None
