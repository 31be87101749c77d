from __future__ import annotations

import numpy as np
import pytest
import trimesh

from garden_models.metrics.mesh import compare_meshes, enclosed_volume, sample_surface


def test_a_mesh_equals_itself_up_to_the_sampling() -> None:
    ball = trimesh.creation.icosphere(3)
    found = compare_meshes(ball.vertices, ball.faces, ball.vertices, ball.faces)
    assert found.chamfer < 0.004 and found.f_score == pytest.approx(1.0)
    assert found.volume_ratio == pytest.approx(1.0)


def test_a_grown_ball_is_off_by_the_difference_of_radii() -> None:
    ball = trimesh.creation.icosphere(4)
    grown = 1.2 * ball.vertices
    found = compare_meshes(grown, ball.faces, ball.vertices, ball.faces)
    assert found.size == pytest.approx(np.sqrt(12.0), rel=1e-3)
    assert found.chamfer == pytest.approx(0.2 / np.sqrt(12.0), rel=0.03)
    assert found.volume_ratio == pytest.approx(1.2**3)
    assert found.f_score == 0.0


def test_a_missing_half_shows_in_completeness_only() -> None:
    ball = trimesh.creation.icosphere(4)
    half = ball.faces[ball.triangles_center[:, 0] > 0]
    found = compare_meshes(ball.vertices, half, ball.vertices, ball.faces)
    assert found.accuracy < 0.005
    assert found.completeness > 0.05


def test_volume_matches_trimesh() -> None:
    torus = trimesh.creation.torus(1.0, 0.3)
    assert enclosed_volume(torus.vertices, torus.faces) == pytest.approx(torus.volume)


def test_samples_are_spread_by_area() -> None:
    box = trimesh.creation.box([1.0, 2.0, 4.0])
    points = sample_surface(box.vertices, box.faces, 20_000)
    on_ends = np.isclose(np.abs(points[:, 2]), 2.0).mean()
    assert on_ends == pytest.approx(2 * 2.0 / box.area, abs=0.01)
    flat = np.zeros((3, 3))
    with pytest.raises(ValueError, match="without any area"):
        sample_surface(flat, np.array([[0, 1, 2]]), 10)
