from __future__ import annotations

import numpy as np
import pytest
import trimesh

from garden_models.meshing.closing import close_mesh
from garden_models.meshing.manifold import is_closed
from garden_models.meshing.triangles import signed_volume
from garden_models.metrics.mesh import compare_meshes
from garden_models.scene import BadGeometry
from tests.garden_models.meshing.staged import block


def fine_block() -> trimesh.Trimesh:
    mesh = block()
    mesh.merge_vertices()
    return mesh.subdivide_to_size(0.015)


def test_a_closed_mesh_stays_as_it_is() -> None:
    mesh = trimesh.creation.icosphere(3, 0.2)
    found = close_mesh(mesh.vertices, mesh.faces)
    assert not found.remade and is_closed(found.surface.faces)
    assert signed_volume(found.surface) == pytest.approx(mesh.volume)


def test_vertices_doubled_along_seams_are_joined() -> None:
    mesh = trimesh.creation.icosphere(2, 0.2)
    soup = mesh.vertices[mesh.faces].reshape(-1, 3)
    found = close_mesh(soup, np.arange(len(soup)).reshape(-1, 3))
    assert not found.remade and is_closed(found.surface.faces)
    assert len(found.surface.vertices) == len(mesh.vertices)


def test_an_inside_out_mesh_is_turned() -> None:
    mesh = trimesh.creation.icosphere(2, 0.2)
    found = close_mesh(mesh.vertices, mesh.faces[:, ::-1])
    assert signed_volume(found.surface) == pytest.approx(mesh.volume)


@pytest.mark.parametrize("scale", [1.0, 30.0])
def test_a_mesh_with_holes_is_closed_where_its_surface_ends(scale: float) -> None:
    """The underside is missing, and a hole in the side."""
    mesh = fine_block()
    middle = mesh.triangles_center
    high = mesh.bounds[1]
    underside = middle[:, 1] > high[1] - 1e-3
    hole = np.linalg.norm(middle - mesh.vertices[100], axis=1) < 0.02
    torn = mesh.faces[~(underside | hole)]
    found = close_mesh(scale * mesh.vertices, torn)
    assert found.remade and is_closed(found.surface.faces)
    assert signed_volume(found.surface) == pytest.approx(scale**3 * mesh.volume, rel=0.06)
    result = compare_meshes(
        found.surface.vertices / scale, found.surface.faces, mesh.vertices, mesh.faces
    )
    assert result.chamfer < 0.01


def test_small_holes_are_filled_and_all_else_stays() -> None:
    mesh = trimesh.creation.icosphere(4, 0.2)
    middle = mesh.triangles_center
    kept = mesh.faces[
        (np.linalg.norm(middle - mesh.vertices[7], axis=1) > 0.015)
        & (np.linalg.norm(middle - mesh.vertices[900], axis=1) > 0.012)
    ]
    assert len(kept) < len(mesh.faces) - 5
    found = close_mesh(mesh.vertices, kept)
    assert not found.remade and is_closed(found.surface.faces)
    assert signed_volume(found.surface) == pytest.approx(mesh.volume, rel=1e-3)


def test_crumbs_are_dropped_and_a_second_piece_is_kept() -> None:
    ball = trimesh.creation.icosphere(2, 0.2)
    crumb = trimesh.creation.icosphere(1, 0.01)
    crumb.apply_translation([0.5, 0, 0])
    other = trimesh.creation.icosphere(2, 0.1)
    other.apply_translation([0, 0.5, 0])
    all_of_it = trimesh.util.concatenate([ball, crumb, other])
    found = close_mesh(all_of_it.vertices, all_of_it.faces)
    assert signed_volume(found.surface) == pytest.approx(ball.volume + other.volume, rel=1e-6)


@pytest.mark.parametrize("flat", ["nothing", "sheet", "point"])
def test_what_encloses_nothing_is_refused(flat: str) -> None:
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    faces = {"nothing": np.zeros((0, 3), int), "sheet": np.array([[0, 1, 2], [0, 2, 3]])}
    vertices = np.zeros((3, 3)) if flat == "point" else square
    with pytest.raises(BadGeometry, match="encloses"):
        close_mesh(vertices, faces.get(flat, np.array([[0, 1, 2]])))
