"""A simplified outline stays within its tolerance and keeps its area."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.geometry.outline import signed_area
from garden_models.geometry.simplify import crosses_itself, simplify_polygon


def noisy_table(noise: float, seed: int = 0) -> np.ndarray:
    """Return a 1.6 m x 0.9 m rectangle of 500 vertices, far from the origin."""
    rng = np.random.default_rng(seed)
    around = np.linspace(0, 4, 500, endpoint=False)
    side, along = around.astype(int), around % 1
    x = np.choose(side, [along, np.ones(500), 1 - along, np.zeros(500)])
    y = np.choose(side, [np.zeros(500), along, np.ones(500), 1 - along])
    return np.stack([1.6 * x + 40, 0.9 * y - 25], axis=1) + rng.normal(0, noise, (500, 2))


def on_outline(polygon: np.ndarray, count: int = 20) -> np.ndarray:
    """Return points all along the edges."""
    share = np.linspace(0, 1, count, endpoint=False)[None, :, None]
    after = np.roll(polygon, -1, axis=0)
    return (polygon[:, None] * (1 - share) + after[:, None] * share).reshape(-1, 2)


def farthest(points: np.ndarray, polygon: np.ndarray) -> float:
    """Return the largest distance of the points from the polygon's edges."""
    a, edge = polygon[None], (np.roll(polygon, -1, axis=0) - polygon)[None]
    share = ((points[:, None] - a) * edge).sum(-1) / np.maximum((edge**2).sum(-1), 1e-30)
    foot = a + np.clip(share, 0, 1)[..., None] * edge
    return float(np.linalg.norm(points[:, None] - foot, axis=-1).min(axis=1).max())


@pytest.mark.parametrize("noise", [0.0, 0.001, 0.003])
def test_within_the_tolerance_with_the_area_and_few_vertices(noise: float) -> None:
    polygon = noisy_table(noise)
    simple, tolerance = simplify_polygon(polygon, 0.012)
    assert tolerance == 0.012
    assert 4 <= len(simple) < 60
    assert farthest(on_outline(simple), polygon) <= tolerance
    assert farthest(on_outline(polygon), simple) <= tolerance
    assert signed_area(simple) == pytest.approx(signed_area(polygon), rel=0.01)
    assert not crosses_itself(simple)


def test_a_tolerance_that_would_lose_area_is_made_smaller() -> None:
    angle = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    disc = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    simple, tolerance = simplify_polygon(disc, 0.2)
    assert 0 < tolerance < 0.2
    assert signed_area(simple) == pytest.approx(signed_area(disc), rel=0.01)


def test_nothing_to_simplify() -> None:
    square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    for tolerance in (0.0, 0.01):
        np.testing.assert_allclose(simplify_polygon(square, tolerance)[0], square, atol=1e-6)
    assert simplify_polygon(square, 0.0)[1] == 0.0


def test_crossing_edges_are_seen() -> None:
    bow_tie = np.array([[0.0, 0], [1, 1], [1, 0], [0, 1]])
    assert crosses_itself(bow_tie)
    assert not crosses_itself(bow_tie[[0, 2, 1, 3]])
