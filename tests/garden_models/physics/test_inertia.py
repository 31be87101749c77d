"""Mass properties against formulas and an independent implementation."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from garden_models.physics.config import DensityPrior
from garden_models.physics.inertia import mass_properties, solid_properties
from garden_models.scene import BadGeometry


def test_box_formula():
    solid = trimesh.creation.box([0.2, 0.3, 0.5])
    got = solid_properties(solid.vertices + np.array([5.0, -3.0, 1.0]), solid.faces)
    assert got.volume == pytest.approx(0.03)
    np.testing.assert_allclose(got.centroid, [5, -3, 1], atol=1e-12)
    expected = 0.03 / 12 * np.diag([0.3**2 + 0.5**2, 0.2**2 + 0.5**2, 0.2**2 + 0.3**2])
    np.testing.assert_allclose(got.inertia, expected, atol=1e-12)


def test_sphere_formula():
    solid = trimesh.creation.icosphere(subdivisions=5, radius=0.3)
    got = solid_properties(solid.vertices, solid.faces)
    volume = 4 / 3 * np.pi * 0.3**3
    assert got.volume == pytest.approx(volume, rel=2e-3)
    np.testing.assert_allclose(got.inertia, np.eye(3) * 0.4 * volume * 0.09, rtol=5e-3, atol=1e-9)


@pytest.mark.parametrize("inside_out", [False, True])
def test_equals_trimesh_for_any_solid(inside_out):
    rng = np.random.default_rng(0)
    solid = trimesh.convex.convex_hull(rng.normal(size=(40, 3)) @ rng.normal(size=(3, 3)))
    faces = solid.faces[:, ::-1] if inside_out else solid.faces
    got = solid_properties(solid.vertices, faces)
    assert got.volume == pytest.approx(solid.volume)
    np.testing.assert_allclose(got.centroid, solid.center_mass, atol=1e-9)
    np.testing.assert_allclose(got.inertia, solid.moment_inertia, rtol=1e-9, atol=1e-9)
    # The tensor of a real body: positive, and each moment at most the sum of the others.
    moments = np.linalg.eigvalsh(got.inertia)
    assert moments[0] > 0
    assert moments[2] <= moments[0] + moments[1] + 1e-12


def test_density_is_stated_and_mass_bounded():
    solid = trimesh.creation.box([0.1, 0.1, 0.1])
    mass = mass_properties(solid.vertices, solid.faces)
    assert mass.mass_kg == pytest.approx(0.4)
    assert "400 kg/m^3" in mass.note
    huge = mass_properties(solid.vertices * 100, solid.faces, DensityPrior(most_mass_kg=50))
    assert huge.mass_kg == 50
    assert "limited" in huge.note
    # Inertia belongs to the mass that is used.
    side = 10.0
    np.testing.assert_allclose(huge.inertia, np.eye(3) * 50 * side**2 / 6, rtol=1e-9, atol=1e-9)


def test_flat_mesh_has_no_mass():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    with pytest.raises(BadGeometry, match="close it"):
        solid_properties(vertices, np.array([[0, 1, 2], [0, 2, 1]]))
