from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from garden_models.meshing.manifold import is_closed
from garden_models.meshing.subdivide import split_edges, unique_edges
from garden_models.meshing.triangles import TriangleSurface, face_areas, signed_volume


def _ball() -> TriangleSurface:
    ball = trimesh.creation.icosphere(1)
    return TriangleSurface(np.asarray(ball.vertices), np.asarray(ball.faces))


def test_edges_of_a_closed_mesh_obey_euler() -> None:
    ball = _ball()
    edges, of_face = unique_edges(ball.faces)
    assert len(ball.vertices) - len(edges) + len(ball.faces) == 2
    first = ball.faces[:, [0, 1]]
    np.testing.assert_array_equal(np.sort(first, axis=1), edges[of_face[:, 0]])


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 1.0))
def test_any_choice_of_edges_keeps_the_mesh_closed(seed: int, share: float) -> None:
    ball = _ball()
    edges, _ = unique_edges(ball.faces)
    marked = np.random.default_rng(seed).random(len(edges)) < share
    split, ends = split_edges(ball, marked)
    assert is_closed(split.faces)
    assert len(split.faces) == len(ball.faces) + 2 * marked.sum()
    assert face_areas(split).sum() == pytest.approx(face_areas(ball).sum())
    assert signed_volume(split) == pytest.approx(signed_volume(ball))
    middles = split.vertices[len(ball.vertices) :]
    np.testing.assert_allclose(middles, ball.vertices[ends].mean(axis=1))
