"""Procedural shapes: real sizes, closed outward surfaces, the same numbers the same shape."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.disentanglement.training.shapes.families import (
    FAMILIES,
    FURNITURE,
    SMALL,
    make_shape,
)
from garden_models.disentanglement.training.shapes.shape import LONGEST_EDGE, subdivided


def volume(shape) -> float:
    a, b, c = (shape.vertices[shape.faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


@pytest.mark.parametrize("family", sorted(FAMILIES))
def test_members_stand_on_their_base_in_metres(family):
    for member in range(4):
        shape = make_shape(family, member)
        assert np.isfinite(shape.vertices).all()
        assert shape.vertices[:, 1].max() == pytest.approx(0, abs=1e-12)
        middle = (shape.vertices.min(axis=0) + shape.vertices.max(axis=0))[[0, 2]] / 2
        np.testing.assert_allclose(middle, 0, atol=1e-9)
        low, high = (0.25, 3.0) if family in FURNITURE else (0.02, 1.6)
        assert low < shape.size < high
        assert volume(shape) > 0  # faces point outwards
        edge = shape.vertices[shape.faces] - np.roll(shape.vertices[shape.faces], -1, axis=1)
        assert np.linalg.norm(edge, axis=2).max() <= LONGEST_EDGE * (1 + 1e-9)


def test_the_same_numbers_give_the_same_shape_and_others_another():
    for family in ("chair", "mug"):
        make_shape.cache_clear()
        first = make_shape(family, 5)
        make_shape.cache_clear()
        again, other = make_shape(family, 5), make_shape(family, 6)
        np.testing.assert_array_equal(first.vertices, again.vertices)
        assert first.vertices.shape != other.vertices.shape or not np.allclose(
            first.vertices, other.vertices
        )


def test_thousands_of_members_are_distinct():
    extents = {
        tuple(np.round(make_shape(family, member).extent, 6))
        for family in ("bottle", "carton")
        for member in range(1000)
    }
    assert len(extents) == 2000
    assert len(FURNITURE) >= 15
    assert len(SMALL) >= 30


def test_shelves_lie_on_the_shape():
    for family in ("table", "shelf", "carton"):
        for member in range(6):
            shape = make_shape(family, member)
            low, high = shape.vertices.min(axis=0), shape.vertices.max(axis=0)
            for shelf in shape.shelves:
                assert 0 < shelf.height <= -low[1] + 1e-9
                assert low[0] - 1e-9 <= shelf.x[0] < shelf.x[1] <= high[0] + 1e-9
                assert low[2] - 1e-9 <= shelf.z[0] < shelf.z[1] <= high[2] + 1e-9


def test_subdivision_keeps_the_area():
    vertices = np.array([[0.0, 0, 0], [3, 0, 0], [0, 1, 0]])
    finer, faces = subdivided(vertices, np.array([[0, 1, 2]]), 0.4)
    a, b, c = (finer[faces[:, k]] for k in range(3))
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == pytest.approx(1.5)
    assert len(faces) > 8
