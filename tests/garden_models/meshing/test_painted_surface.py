from __future__ import annotations

import numpy as np
import trimesh

from garden_models.meshing.painted_surface import PaintedSurface
from tests.garden_models.meshing.staged import colour_of


def ball() -> trimesh.Trimesh:
    return trimesh.creation.icosphere(5, 0.1)


def test_colours_of_vertices_are_found_between_them() -> None:
    mesh = ball()
    paint = PaintedSurface(mesh.vertices, mesh.faces, colour_of(mesh.vertices))
    places = mesh.triangles_center
    found = paint.sample(places, mesh.face_normals)
    assert found.observed.all() and found.filled.all()
    assert np.abs(found.rgb - colour_of(places).astype(float)).mean() < 3.0


def test_places_a_little_off_the_surface_have_its_colour() -> None:
    """A thinned mesh runs beside the one that it was made of."""
    mesh = ball()
    paint = PaintedSurface(mesh.vertices, mesh.faces, colour_of(mesh.vertices))
    for off in (-0.002, 0.002):
        places = mesh.triangles_center + off * mesh.face_normals
        found = paint.sample(places, mesh.face_normals).rgb
        assert np.abs(found - colour_of(mesh.triangles_center).astype(float)).mean() < 4.0


def test_far_places_have_the_colour_of_the_nearest_vertex() -> None:
    mesh = ball()
    paint = PaintedSurface(mesh.vertices, mesh.faces, colour_of(mesh.vertices))
    found = paint.sample(3.0 * mesh.vertices, -mesh.vertex_normals).rgb
    np.testing.assert_array_equal(found, colour_of(mesh.vertices))


def test_a_texture_goes_before_colours_of_vertices() -> None:
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]], float)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    picture = np.random.default_rng(0).integers(0, 256, (64, 64, 3), np.uint8)
    paint = PaintedSurface(square, faces, np.zeros((4, 3), np.uint8), uv, picture)
    row, column = np.mgrid[0:64, 0:64]
    u, v = (column.ravel() + 0.5) / 64, 1.0 - (row.ravel() + 0.5) / 64
    places = np.stack([u, np.zeros_like(u), v], 1)
    found = paint.sample(places, np.tile([0.0, 1.0, 0.0], (len(places), 1))).rgb
    off = np.abs(found.reshape(64, 64, 3) - picture)
    assert off.mean() < 1.0
