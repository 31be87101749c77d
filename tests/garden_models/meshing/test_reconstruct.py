from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest
import trimesh

from garden_models.geometry.rigid import transform_points
from garden_models.meshing.config import MeshObject
from garden_models.meshing.reconstruct import mesh_object
from garden_models.metrics.mesh import MeshComparison, compare_meshes
from garden_models.scene import BadGeometry, ObjectMesh
from tests.garden_models.meshing.staged import (
    SUPPORT,
    Staged,
    block,
    colour_of,
    orbit,
    stage,
    standing,
)

SMALL = MeshObject(max_resolution=72, geometry_faces=3000, max_faces=4000)


def _mesh(staged: Staged, config: MeshObject = SMALL) -> ObjectMesh:
    return mesh_object(staged.reconstruction, staged.gravity_view, staged.masks, config)


def _against_truth(mesh: ObjectMesh, staged: Staged) -> MeshComparison:
    placed = transform_points(mesh.gv_from_object, mesh.vertices)
    return compare_meshes(
        placed, mesh.faces, np.asarray(staged.truth.vertices), np.asarray(staged.truth.faces)
    )


@cache
def _orbit_block() -> tuple[Staged, ObjectMesh]:
    staged = stage([standing(block(), 0.02, -0.01)], orbit(12, 360, 30, 0.7))
    return staged, _mesh(staged)


def test_an_orbited_object_is_close_to_the_truth() -> None:
    staged, mesh = _orbit_block()
    found = _against_truth(mesh, staged)
    assert found.chamfer < 0.008, found
    assert found.f_score > 0.97, found
    assert abs(found.volume_ratio - 1.0) < 0.04, found
    assert mesh.verdict.status == "ok", mesh.verdict


def test_the_mesh_is_closed_and_looks_outward() -> None:
    _, mesh = _orbit_block()
    independent = trimesh.Trimesh(mesh.vertices, mesh.faces, process=True)
    assert mesh.watertight and independent.is_watertight and independent.is_winding_consistent
    assert independent.volume > 0
    assert len(mesh.faces) <= SMALL.max_faces


def test_the_object_frame_is_upright_on_its_footprint() -> None:
    staged, mesh = _orbit_block()
    assert mesh.vertices[:, 1].max() <= 0.0
    np.testing.assert_allclose(mesh.gv_from_object[:3, :3], np.eye(3))
    assert mesh.gv_from_object[1, 3] == pytest.approx(SUPPORT)
    truth = np.asarray(staged.truth.bounds)
    middle = mesh.gv_from_object[[0, 2], 3]
    np.testing.assert_allclose(middle, truth.mean(axis=0)[[0, 2]], atol=0.006)
    foot = mesh.vertices[mesh.vertices[:, 1] > -1e-6]
    assert len(foot) > 10, "the underside is flat"


def test_colours_are_those_of_the_photos() -> None:
    _, mesh = _orbit_block()
    placed = transform_points(mesh.gv_from_object, mesh.vertices[mesh.observed])
    error = np.abs(colour_of(placed).astype(float) - mesh.vertex_rgb[mesh.observed])
    assert np.median(error) < 6.0


def test_only_the_underside_is_unobserved_after_an_orbit() -> None:
    _, mesh = _orbit_block()
    hidden = mesh.vertices[~mesh.observed]
    assert mesh.observed.mean() > 0.7
    assert np.mean(hidden[:, 1] > -0.01) > 0.9


def test_the_result_is_the_same_every_time_and_progress_rises() -> None:
    staged, mesh = _orbit_block()
    told: list[float] = []
    again = mesh_object(
        staged.reconstruction,
        staged.gravity_view,
        staged.masks,
        SMALL,
        lambda share, _: told.append(share),
    )
    assert told == sorted(told) and told[-1] == 1.0
    np.testing.assert_array_equal(again.vertices, mesh.vertices)
    np.testing.assert_array_equal(again.vertex_rgb, mesh.vertex_rgb)


def test_a_neighbour_that_hides_the_object_neither_carves_nor_joins_it() -> None:
    post = standing(trimesh.creation.box([0.08, 0.15, 0.08]), 0.05, -0.14)
    staged = stage([standing(block()), post], orbit(12, 360, 30, 0.7))
    found = _against_truth(_mesh(staged), staged)
    assert found.chamfer < 0.01, found
    assert abs(found.volume_ratio - 1.0) < 0.06, found


def test_a_few_wrong_masks_do_not_carve_the_object() -> None:
    staged = stage([standing(block())], orbit(12, 360, 30, 0.7))
    masks = list(staged.masks.masks)
    broken = masks[3].copy()
    rows = np.nonzero(broken)[0]
    broken[: int(np.median(rows))] = False
    masks[3] = broken
    damaged = dataclasses.replace(
        staged, masks=dataclasses.replace(staged.masks, masks=tuple(masks))
    )
    found = _against_truth(_mesh(damaged), staged)
    assert found.chamfer < 0.01, found


def test_without_depth_the_silhouettes_alone_still_give_the_shape() -> None:
    staged = stage(
        [standing(trimesh.creation.icosphere(3, 0.08))], orbit(12, 360, 30, 0.6), holes=0.98
    )
    found = _against_truth(_mesh(staged), staged)
    assert found.chamfer < 0.01, found


def test_an_object_seen_from_one_side_is_degraded_and_says_so() -> None:
    staged = stage([standing(block())], orbit(7, 70, 30, 0.7))
    mesh = _mesh(staged)
    assert mesh.watertight
    assert mesh.verdict.status == "degraded"
    assert "one side" in " ".join(mesh.verdict.reasons)
    assert _against_truth(mesh, staged).chamfer < 0.02


@pytest.mark.slow
def test_symmetry_completes_the_unseen_back_of_a_ball() -> None:
    staged = stage([standing(trimesh.creation.icosphere(4, 0.08))], orbit(8, 60, 30, 0.6))
    mesh = _mesh(staged)
    assert any("mirror symmetry" in note for note in mesh.completion), mesh.completion
    found = _against_truth(mesh, staged)
    assert found.chamfer < 0.015, found
    plain = _mesh(staged, dataclasses.replace(SMALL, mirror=False))
    assert found.chamfer < 0.7 * _against_truth(plain, staged).chamfer


@pytest.mark.slow
def test_nothing_underneath_is_a_reason_to_degrade() -> None:
    staged = stage([standing(block())], orbit(10, 360, 30, 0.7), support=False)
    mesh = _mesh(staged)
    assert mesh.watertight and mesh.verdict.status == "degraded"
    assert "stands on" in " ".join(mesh.verdict.reasons)


def test_feet_below_a_wrong_support_are_not_cut_off() -> None:
    staged = stage([standing(block())], orbit(10, 360, 30, 0.7))
    support = staged.masks.support
    assert support is not None
    raised = dataclasses.replace(support, height_gv=SUPPORT - 0.03)
    masks = dataclasses.replace(staged.masks, support=raised)
    mesh = _mesh(dataclasses.replace(staged, masks=masks))
    assert np.ptp(mesh.vertices[:, 1]) > 0.17
    assert any("under its support" in note for note in mesh.completion)


def test_an_object_that_nobody_sees_is_refused() -> None:
    staged, _ = _orbit_block()
    empty = tuple(np.zeros_like(mask) for mask in staged.masks.masks)
    masks = dataclasses.replace(staged.masks, masks=empty)
    with pytest.raises(BadGeometry, match="photograph it from more sides"):
        _mesh(dataclasses.replace(staged, masks=masks))


@pytest.mark.parametrize(
    "wrong",
    [
        {"min_resolution": 200, "max_resolution": 100},
        {"geometry_faces": 10},
        {"max_faces": 500},
        {"hull_outvoted_share": 0.6},
    ],
)
def test_impossible_settings_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="got"):
        MeshObject(**wrong)  # type: ignore[arg-type]
