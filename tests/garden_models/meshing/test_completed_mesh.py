"""A model's mesh in our object frame: upright, in metres, closed, painted; its pose judged."""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest

from garden_models.geometry.rotation import yaw_gv
from garden_models.geometry.upright import nearest_yaw, tilt_deg
from garden_models.meshing.completed_mesh import complete_mesh
from garden_models.meshing.config import MeshObject
from garden_models.meshing.sam3d_objects import Sam3dObjects
from garden_models.meshing.triangles import TriangleSurface, signed_volume
from garden_models.metrics.mesh import compare_meshes
from garden_models.scene import BadGeometry, ObjectMesh
from tests.doubles.sam3d_pipeline import Sam3dPipeline
from tests.doubles.truth_scene import TruthScene, staged_scene
from tests.garden_models.meshing.staged import (
    SUPPORT,
    Staged,
    block,
    colour_of,
    orbit,
    stage,
    standing,
)

YAW = 0.7
CONFIG = MeshObject(method="sam3d_objects", geometry_faces=4000, max_faces=12_000)


@cache
def staged() -> Staged:
    return stage([standing(block(), 0.03, 0.02)], orbit(5, 120, 30, 0.7))


@cache
def truth() -> TruthScene:
    return staged_scene(staged(), yaw_gv(YAW))


def complete(**options) -> ObjectMesh:
    predict = Sam3dObjects(Sam3dPipeline(truth(), **options), "cpu")
    one = staged()
    return complete_mesh(one.reconstruction, one.gravity_view, one.masks, predict, CONFIG)


@cache
def completed() -> ObjectMesh:
    return complete()


def in_gv(mesh: ObjectMesh) -> np.ndarray:
    pose = mesh.gv_from_object
    return mesh.vertices @ pose[:3, :3].T + pose[:3, 3]


def test_it_stands_where_the_object_stands() -> None:
    mesh = completed()
    true = staged().truth
    result = compare_meshes(in_gv(mesh), mesh.faces, true.vertices, true.faces)
    assert result.chamfer < 0.005 and result.volume_ratio == pytest.approx(1.0, abs=0.01)
    assert mesh.verdict.status == "ok", mesh.verdict


def test_its_frame_is_upright_with_the_origin_under_its_foot() -> None:
    mesh = completed()
    assert mesh.vertices[:, 1].max() == pytest.approx(0.0, abs=1e-6)
    foot = mesh.vertices[mesh.vertices[:, 1] > -1e-3]
    middle = 0.5 * (foot.min(axis=0) + foot.max(axis=0))
    np.testing.assert_allclose(middle[[0, 2]], 0.0, atol=2e-3)
    rotation = mesh.gv_from_object[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-6)
    assert tilt_deg(rotation) < 0.1
    assert nearest_yaw(rotation) == pytest.approx(YAW, abs=1e-3)
    assert mesh.gv_from_object[1, 3] == pytest.approx(SUPPORT, abs=3e-3)


def test_it_is_closed_and_of_bounded_size() -> None:
    mesh = completed()
    assert mesh.watertight and len(mesh.faces) <= CONFIG.max_faces
    surface = TriangleSurface(mesh.vertices.astype(float), mesh.faces)
    assert signed_volume(surface) > 0


@pytest.mark.parametrize("textured", [False, True])
def test_its_colours_are_the_models_also_where_no_photo_saw_it(textured: bool) -> None:
    mesh = complete(textured=textured)
    off = np.abs(mesh.vertex_rgb.astype(float) - colour_of(in_gv(mesh))).mean(1)
    assert np.median(off[mesh.observed]) < 10 and np.median(off[~mesh.observed]) < 10
    assert 0.2 < mesh.observed.mean() < 0.9
    assert any("texture" in line for line in mesh.completion) == textured
    missed = next(line for line in mesh.completion if "of 255" in line)
    assert float(missed.split(" by ")[1].split(" of ")[0]) < 8


def test_a_mesh_with_holes_is_closed_anew_and_that_is_said() -> None:
    mesh = complete(torn=True)
    assert mesh.watertight and any("holes" in line for line in mesh.completion)
    result = compare_meshes(in_gv(mesh), mesh.faces, staged().truth.vertices, staged().truth.faces)
    assert result.chamfer < 0.02


def test_a_pose_that_leans_a_little_is_kept_as_the_model_gave_it() -> None:
    mesh = complete(lean_deg=6.0)
    assert tilt_deg(mesh.gv_from_object[:3, :3]) == pytest.approx(6.0, abs=0.1)
    assert mesh.verdict.status == "ok"
    assert any("leans by 6.0 degrees" in line for line in mesh.completion)


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ("quaternion_order", "leans"),
        ("up_axis", "up axis"),
        ("transposed_rotation", "leans"),
        ("camera_axes", ""),
        ("other_unit", "times as large as its points"),
    ],
)
def test_a_broken_convention_is_not_ok(fault: str, said: str) -> None:
    mesh = complete(fault=fault)
    assert mesh.verdict.status == "degraded"
    assert said in "; ".join(mesh.verdict.reasons)


def test_an_object_with_hardly_a_point_is_refused() -> None:
    one = staged()
    few = dataclasses.replace(one.masks, points_gv=one.masks.points_gv.subset(np.arange(10)))
    with pytest.raises(BadGeometry, match="10 points"):
        complete_mesh(
            one.reconstruction,
            one.gravity_view,
            few,
            Sam3dObjects(Sam3dPipeline(truth()), "cpu"),
            CONFIG,
        )


def test_the_photo_that_was_asked_is_named() -> None:
    assert any("from photo" in line for line in completed().completion)
