"""Convex pieces: convex, few, inside the hull, and near the mesh's volume."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from garden_models.physics.config import Cutting
from garden_models.physics.convex_pieces import convex_pieces, hull_piece
from garden_models.physics.inertia import solid_properties
from garden_models.scene import BadGeometry
from tests.garden_models.physics.room import box, mug, upright


def volume(pieces):
    return sum(solid_properties(piece.vertices, piece.faces).volume for piece in pieces)


def table():
    legs = [
        trimesh.creation.box([0.08, 0.08, 0.8], transform=_moved(x, y, -0.4))
        for x in (-0.4, 0.4)
        for y in (-0.2, 0.2)
    ]
    return trimesh.boolean.union([trimesh.creation.box([1, 0.6, 0.1]), *legs]).subdivide()


def _moved(x, y, z):
    return trimesh.transformations.translation_matrix([x, y, z])


@pytest.mark.parametrize("make", [mug, table], ids=["mug", "table"])
def test_concave_things_are_cut_well(make):
    mesh = upright("thing", make())
    pieces = convex_pieces(mesh.vertices, mesh.faces)
    solid = solid_properties(mesh.vertices, mesh.faces).volume
    hull = trimesh.convex.convex_hull(mesh.vertices).volume
    assert 1 < len(pieces) <= Cutting().most_pieces
    assert volume(pieces) < min(1.6 * solid, 0.6 * hull)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    for piece in pieces:
        assert (piece.vertices >= low - 1e-9).all()
        assert (piece.vertices <= high + 1e-9).all()
        assert len(piece.vertices) <= 64
        as_mesh = trimesh.Trimesh(piece.vertices, piece.faces)
        assert as_mesh.is_convex
        assert as_mesh.volume > 0


def test_the_inside_of_a_mug_stays_free():
    mesh = upright("mug", mug())
    probe = np.array([0.0, -0.05, 0.0])
    for piece in convex_pieces(mesh.vertices, mesh.faces):
        assert not trimesh.Trimesh(piece.vertices, piece.faces).contains([probe])[0]


def test_noise_is_not_cut_out():
    mesh = upright("box", box(), noise=0.015)
    assert len(convex_pieces(mesh.vertices, mesh.faces, noise_m=0.015 * 0.2)) <= 2


def test_same_input_same_pieces():
    mesh = upright("mug", mug(), noise=0.01)
    first, second = (convex_pieces(mesh.vertices, mesh.faces) for _ in range(2))
    assert all(np.array_equal(a.vertices, b.vertices) for a, b in zip(first, second, strict=True))


def test_flat_and_few():
    assert hull_piece(np.zeros((3, 3)), 0.0) is None
    assert hull_piece(np.random.default_rng(0).random((20, 3)) * [1, 1, 0], 1e-6) is None
    flat = np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 1], [1, 0, 1]])
    with pytest.raises(BadGeometry, match="flat"):
        convex_pieces(flat, np.array([[0, 1, 2], [1, 3, 2]]))
