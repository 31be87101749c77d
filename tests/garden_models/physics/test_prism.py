"""Prisms of supports cover the outline and nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.geometry.outline import inside_polygon, signed_area
from garden_models.physics.prism import convex_parts, support_prisms

L_SHAPE = np.array([[0.0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]])
U_SHAPE = np.array([[0.0, 0], [3, 0], [3, 2], [2, 2], [2, 1], [1, 1], [1, 2], [0, 2]])


@pytest.mark.parametrize("outline", [L_SHAPE, U_SHAPE, L_SHAPE[::-1]])
def test_parts_are_convex_and_tile_the_outline(outline):
    parts = convex_parts(outline)
    assert len(parts) <= 3
    assert sum(signed_area(part) for part in parts) == pytest.approx(abs(signed_area(outline)))
    points = np.random.default_rng(0).uniform(-0.5, 3.5, (2000, 2))
    inside = np.sum([inside_polygon(points, part) for part in parts], axis=0)
    assert (inside == inside_polygon(points, outline)).all()


def test_prisms_have_their_top_at_the_support():
    prisms = support_prisms(L_SHAPE, 0.7, 0.05)
    assert len(prisms) == 2
    for prism in prisms:
        assert prism.vertices[:, 1].min() == pytest.approx(0.7)
        assert prism.vertices[:, 1].max() == pytest.approx(0.75)


def test_ragged_outline_becomes_its_hull():
    angle = np.linspace(0, 2 * np.pi, 80, endpoint=False)
    radius = 1 + 0.01 * np.cos(40 * angle)
    outline = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    assert len(convex_parts(outline)) == 1
