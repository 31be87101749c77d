"""Signed distances against formulas."""

from __future__ import annotations

import numpy as np
import trimesh

from garden_models.disentanglement.signed_distance import inside_mesh, signed_distance


def test_sphere():
    solid = trimesh.creation.icosphere(subdivisions=5, radius=0.5)
    points = np.random.default_rng(0).uniform(-1, 1, (2000, 3))
    expected = np.linalg.norm(points, axis=1) - 0.5
    got = signed_distance(points + 7, solid.vertices + 7, solid.faces)
    assert np.abs(got - expected).max() < 0.01
    clear = np.abs(expected) > 0.005
    assert (np.sign(got) == np.sign(expected))[clear].all()


def test_axis_parallel_faces_and_hollows():
    outer, inner = trimesh.creation.box([2, 2, 2]), trimesh.creation.box([1, 1, 1])
    hollow = trimesh.boolean.difference([outer, inner])
    points = np.array([[0.0, 0, 0], [0.75, 0, 0], [1.5, 0, 0], [0.75, 0.75, 0.75]])
    assert inside_mesh(points, hollow).tolist() == [False, True, False, True]
    assert signed_distance(np.zeros((0, 3)), hollow.vertices, hollow.faces).shape == (0,)
