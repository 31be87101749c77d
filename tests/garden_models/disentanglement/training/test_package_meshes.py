"""Meshes of installed packages: found where they lie, upright, each in one split."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from garden_models.disentanglement.training.shapes.package_meshes import (
    PACKAGES,
    MeshPackage,
    package_shapes,
)
from garden_models.disentanglement.training.splits import SPLITS

PACKAGE = MeshPackage("some_assets", ("meshes/*.stl",), 0.01, 2, "MIT")


@pytest.fixture
def folder(tmp_path):
    """Write a package of 30 bars in centimetres, z up, one of them a metre and a half tall."""
    meshes = tmp_path / "some_assets" / "meshes"
    meshes.mkdir(parents=True)
    for k in range(30):
        height = 150 if k == 0 else 20
        trimesh.creation.box((4, 6 + 0.1 * k, height)).export(meshes / f"bar{k:02d}.stl")
    return tmp_path


def test_meshes_come_upright_in_metres_and_in_one_split_each(folder):
    found = {split: package_shapes(split, (PACKAGE,), folder) for split in SPLITS}
    names = [shape.name for shapes in found.values() for shape in shapes]
    assert len(names) == len(set(names)) == 29  # the tall one stands on no shelf
    assert len(found["train"]) > len(found["test"]) > 0
    for shape in found["train"]:
        np.testing.assert_allclose(shape.extent[1], 0.2, atol=1e-6)
        assert sorted(shape.extent)[0] == pytest.approx(0.04)
        assert shape.vertices[:, 1].max() == pytest.approx(0)
        a, b, c = (shape.vertices[shape.faces[:, k]] for k in range(3))
        assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() > 0


def test_large_meshes_are_simplified(tmp_path):
    meshes = tmp_path / "some_assets" / "meshes"
    meshes.mkdir(parents=True)
    trimesh.creation.icosphere(subdivisions=5, radius=8).export(meshes / "ball.stl")
    (shape,) = (s for split in SPLITS for s in package_shapes(split, (PACKAGE,), tmp_path))
    assert len(shape.faces) <= 4100
    assert shape.size == pytest.approx(0.16, rel=0.02)


def test_packages_that_are_not_installed_give_nothing(tmp_path):
    assert package_shapes("train", PACKAGES, tmp_path) == ()
    assert all(package.licence for package in PACKAGES)
