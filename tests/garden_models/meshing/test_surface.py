from __future__ import annotations

import numpy as np
import pytest
import trimesh

from garden_models.meshing.field import keep_solid, solve_field
from garden_models.meshing.manifold import is_closed
from garden_models.meshing.surface import extract_surface, simplify_surface, smooth_surface
from garden_models.meshing.triangles import (
    TriangleSurface,
    face_areas,
    signed_volume,
    vertex_normals,
)


def _ball_field(radius: float = 12.0, size: int = 32) -> np.ndarray:
    at = np.indices((size,) * 3) - (size - 1) / 2
    return (np.linalg.norm(at, axis=0) - radius).astype(np.float32)


def test_a_ball_has_its_volume_area_and_outward_normals() -> None:
    surface = extract_surface(_ball_field(), np.full(3, -15.5), 1.0)
    assert is_closed(surface.faces)
    assert signed_volume(surface) == pytest.approx(4 / 3 * np.pi * 12**3, rel=0.01)
    assert face_areas(surface).sum() == pytest.approx(4 * np.pi * 12**2, rel=0.01)
    outward = surface.vertices / np.linalg.norm(surface.vertices, axis=1, keepdims=True)
    assert (vertex_normals(surface) * outward).sum(axis=1).min() > 0.97


def test_a_field_that_fills_the_grid_is_closed_at_its_border() -> None:
    surface = extract_surface(np.full((6, 7, 8), -1.0), np.zeros(3), 0.5)
    assert is_closed(surface.faces)
    np.testing.assert_allclose(np.ptp(surface.vertices, axis=0), [3.0, 3.5, 4.0])


def test_smoothing_removes_noise_and_keeps_the_volume() -> None:
    surface = extract_surface(_ball_field(), np.full(3, -15.5), 1.0)
    rng = np.random.default_rng(0)
    rough = TriangleSurface(
        surface.vertices + 0.15 * rng.normal(size=surface.vertices.shape), surface.faces
    )
    smooth = smooth_surface(rough, 12)
    radius = np.linalg.norm(smooth.vertices, axis=1)
    assert radius.std() < 0.5 * np.linalg.norm(rough.vertices, axis=1).std()
    assert signed_volume(smooth) == pytest.approx(signed_volume(surface), rel=0.01)


def test_smoothing_leaves_the_flat_foot_flat() -> None:
    field = np.maximum(_ball_field(), np.indices((32,) * 3)[1] - 20.5)
    surface = extract_surface(field, np.zeros(3), 1.0)
    smooth = smooth_surface(surface, 12, 20.5)
    foot = np.isclose(surface.vertices[:, 1], 20.5)
    assert foot.sum() > 100
    np.testing.assert_array_equal(smooth.vertices[foot, 1], 20.5)


def test_simplifying_keeps_the_shape_closed() -> None:
    surface = extract_surface(_ball_field(), np.full(3, -15.5), 1.0)
    simple = simplify_surface(surface, 600)
    assert is_closed(simple.faces) and len(simple.faces) <= 700
    assert signed_volume(simple) == pytest.approx(signed_volume(surface), rel=0.02)


def test_simplifying_a_tangle_stays_closed() -> None:
    """Noise above a threshold has handles and bridges that collapses pinch together."""
    rng = np.random.default_rng(3)
    field = solve_field(rng.normal(size=(30, 30, 30)), np.full((30, 30, 30), 0.2), steps=4)
    field, pieces = keep_solid(field, 0.05)
    assert pieces == 1
    surface = extract_surface(field, np.zeros(3), 1.0)
    simple = simplify_surface(surface, 4000)
    assert is_closed(simple.faces)
    assert trimesh.Trimesh(simple.vertices, simple.faces, process=True).is_watertight
    assert len(simple.faces) < 0.25 * len(surface.faces)
