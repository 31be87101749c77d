from __future__ import annotations

import numpy as np
import pytest
import trimesh

from garden_models.meshing.manifold import is_closed, separate_touching
from garden_models.meshing.triangles import TriangleSurface, signed_volume


def _welded(*meshes: trimesh.Trimesh) -> TriangleSurface:
    joined = trimesh.util.concatenate(list(meshes))
    joined.merge_vertices()
    return TriangleSurface(np.asarray(joined.vertices), np.asarray(joined.faces))


def _closed_for_trimesh(surface: TriangleSurface) -> bool:
    return bool(trimesh.Trimesh(surface.vertices, surface.faces, process=True).is_watertight)


@pytest.mark.parametrize("shift", [(1.0, 1.0, 0.0), (1.0, 1.0, 1.0)])
def test_boxes_that_touch_along_an_edge_or_at_a_corner_are_parted(
    shift: tuple[float, float, float],
) -> None:
    other = trimesh.creation.box()
    other.apply_translation(shift)
    welded = _welded(trimesh.creation.box(), other)
    parted = separate_touching(welded)
    assert is_closed(parted.faces) and _closed_for_trimesh(parted)
    assert signed_volume(parted) == pytest.approx(2.0, rel=0.05)
    assert len(parted.faces) == len(welded.faces)


def test_two_sheets_joined_at_both_ends_of_an_edge_get_midpoints() -> None:
    """Two pillars touch along an edge; a slab on top joins them there as well."""
    grid = np.zeros((5, 5, 4), bool)
    grid[1, 1, 1] = grid[2, 2, 1] = True
    grid[1:3, 1:3, 2] = True
    voxels = trimesh.voxel.VoxelGrid(grid).as_boxes()
    voxels.merge_vertices()
    faces = np.asarray(voxels.faces)
    order = np.sort(faces, axis=1)
    _, group, count = np.unique(order, axis=0, return_inverse=True, return_counts=True)
    surface = TriangleSurface(np.asarray(voxels.vertices), faces[count[group.ravel()] == 1])
    parted = separate_touching(surface)
    assert is_closed(parted.faces) and _closed_for_trimesh(parted)
    assert signed_volume(parted) == pytest.approx(6.0, rel=0.1)


def test_a_clean_mesh_stays_as_it_is() -> None:
    ball = trimesh.creation.icosphere(3)
    surface = TriangleSurface(np.asarray(ball.vertices), np.asarray(ball.faces))
    kept = separate_touching(surface)
    assert len(kept.faces) == len(ball.faces)
    assert signed_volume(kept) == pytest.approx(ball.volume)


def test_folded_faces_are_dropped() -> None:
    ball = trimesh.creation.icosphere(2)
    faces = np.asarray(ball.faces)
    flap = np.array([[0, 1, 2], [2, 1, 0], [5, 5, 6]])
    surface = TriangleSurface(np.asarray(ball.vertices), np.concatenate([faces, flap]))
    cleaned = separate_touching(surface)
    assert is_closed(cleaned.faces) and len(cleaned.faces) == len(faces)


def test_closedness_agrees_with_trimesh() -> None:
    ball = trimesh.creation.icosphere(2)
    faces = np.asarray(ball.faces)
    assert is_closed(faces)
    assert not is_closed(faces[1:])
    turned = faces.copy()
    turned[0] = turned[0, ::-1]
    assert not is_closed(turned)
    assert not is_closed(faces[:0])
