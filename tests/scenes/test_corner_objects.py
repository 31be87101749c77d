"""Masks, meshes and poses of the sample capture's objects by models that answer its truth."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from garden_models.geometry.rigid import transform_points
from garden_models.meshing.completed_mesh import complete_mesh
from garden_models.meshing.config import MeshObject
from garden_models.metrics.mesh import compare_meshes
from garden_models.metrics.placement import PlacementError, shape_error
from garden_models.placement.config import PlaceObject
from garden_models.placement.place import place
from garden_models.scene import ObjectMasks, ObjectMesh, Placement, Status, Verdict
from garden_models.segmentation.promptable import segment_by_model
from tests.doubles.corner import foundation_pose, put_fault, sam2, sam3, sam3d_objects
from tests.doubles.corner_reconstruction import corner_reconstruction, corner_target
from tests.doubles.truth_scene import corner_scene, placed

pytestmark = pytest.mark.slow

NAMES = ("house", "duck", "jar")
MODELS = {"sam3": sam3, "sam2": sam2, "sam3d_objects": sam3d_objects}


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("weights")


def loaded(folder: Path, module, fault: str = ""):
    name = module.__name__.rsplit(".", 1)[-1]
    put_fault(folder, name, fault)
    return module.load(folder / name, "cpu")


@dataclass(frozen=True)
class Factored:
    masks: ObjectMasks
    mesh: ObjectMesh
    placement: Placement

    @property
    def status(self) -> Status:
        verdict: Verdict = self.masks.verdict.worst(self.mesh.verdict)
        return verdict.worst(self.placement.verdict).status


@cache
def masks_of(name: str, folder: Path, segmenter: str = "sam3", fault: str = "") -> ObjectMasks:
    predict = loaded(folder, MODELS[segmenter], fault)
    return segment_by_model(*corner_reconstruction(), corner_target(name), predict)


@cache
def factored(name: str, folder: Path) -> Factored:
    scene, masks = corner_reconstruction(), masks_of(name, folder)
    complete = loaded(folder, sam3d_objects)
    mesh = complete_mesh(*scene, masks, complete, MeshObject(method="sam3d_objects"))
    estimate = loaded(folder, foundation_pose)
    config = PlaceObject(method="foundation_pose")
    return Factored(masks, mesh, place(*scene, masks, mesh, config, estimate=estimate))


def in_gv(name: str) -> tuple[np.ndarray, np.ndarray]:
    body = next(body for body in corner_scene().bodies if body.name == name)
    return transform_points(corner_reconstruction()[1].gv_from_world, placed(body)), body.faces


def error(name: str, found: Factored) -> PlacementError:
    true, true_faces = in_gv(name)
    ours = transform_points(found.placement.best.gv_from_object, found.mesh.vertices.astype(float))
    symmetry = None if name == "jar" else 1
    return shape_error(ours, found.mesh.faces, true, true_faces, symmetry)


@pytest.mark.parametrize("segmenter", ["sam3", "sam2"])
@pytest.mark.parametrize("name", NAMES)
def test_masks_are_the_true_ones_in_every_photo(name: str, segmenter: str, weights: Path) -> None:
    masks = masks_of(name, weights, segmenter)
    reconstruction, _ = corner_reconstruction()
    index = next(i for i, body in enumerate(corner_scene().bodies) if body.name == name)
    for i, (view, mask) in enumerate(zip(reconstruction.views, masks.masks, strict=True)):
        true = corner_scene().picture(i, view.size).owner == index
        if true.sum() < 60:
            continue
        overlap = (mask & true).sum() / (mask | true).sum()
        assert overlap > 0.94, (view.photo, overlap)
    assert sum(mask.any() for mask in masks.masks) >= 20
    assert masks.verdict.status == "ok", masks.verdict


@pytest.mark.parametrize("name", NAMES)
def test_each_object_is_placed_within_a_hundredth_of_its_size_and_a_degree(
    name: str, weights: Path
) -> None:
    found = factored(name, weights)
    wrong = error(name, found)
    assert wrong.translation < 0.01 and wrong.yaw_deg < 1.0 and wrong.tilt_deg < 1.0, wrong
    assert wrong.scale == pytest.approx(1.0, abs=0.01)
    assert found.status == "ok", (found.masks.verdict, found.mesh.verdict, found.placement.verdict)


@pytest.mark.parametrize("name", NAMES)
def test_its_whole_shape_is_there(name: str, weights: Path) -> None:
    found = factored(name, weights)
    ours = transform_points(found.placement.best.gv_from_object, found.mesh.vertices.astype(float))
    result = compare_meshes(ours, found.mesh.faces, *in_gv(name))
    assert result.chamfer < 0.01 and result.volume_ratio == pytest.approx(1.0, abs=0.03)
    assert found.mesh.watertight


@pytest.mark.parametrize(
    "fault", ["quaternion_order", "up_axis", "transposed_rotation", "camera_axes", "other_unit"]
)
@pytest.mark.parametrize("name", NAMES)
def test_with_a_convention_of_the_mesh_broken_it_is_not_ok(
    name: str, fault: str, weights: Path
) -> None:
    """Also where placement finds by itself where the mesh belongs."""
    complete = loaded(weights, sam3d_objects, fault)
    masks, config = masks_of(name, weights), MeshObject(method="sam3d_objects")
    mesh = complete_mesh(*corner_reconstruction(), masks, complete, config)
    assert mesh.verdict.status == "degraded", mesh.completion


@pytest.mark.parametrize("fault", ["camera_axes", "transposed_rotation", "other_unit"])
def test_with_a_convention_of_the_pose_broken_it_is_not_ok(fault: str, weights: Path) -> None:
    scene, masks = corner_reconstruction(), masks_of("house", weights)
    mesh = factored("house", weights).mesh
    config = PlaceObject(
        method="foundation_pose", max_views=3, pixels_per_view=1200, yaw_starts=8, refined_starts=1
    )
    estimate = loaded(weights, foundation_pose, fault)
    placement = place(*scene, masks, mesh, config, estimate=estimate)
    assert placement.verdict.status == "degraded", placement.why


def test_a_segmenter_that_takes_the_box_for_a_hint_is_not_ok(weights: Path) -> None:
    assert masks_of("house", weights, "sam3", "everything").verdict.status != "ok"
