from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest

from garden_models.geometry.rotation import yaw_gv
from garden_models.metrics.placement import PlacementError, pose_error
from garden_models.placement.compare import Comparison
from garden_models.placement.config import PlaceObject
from garden_models.placement.observation import observe
from garden_models.placement.place import AS_MESHED, place
from garden_models.placement.pose import UprightPose
from garden_models.scene import BadGeometry, ObjectMesh, Placement
from tests.garden_models.meshing.staged import (
    SUPPORT,
    Staged,
    block,
    colour_of,
    orbit,
    stage,
    standing,
)

QUICK = PlaceObject(max_views=5, pixels_per_view=1200, yaw_starts=16)


@cache
def _staged() -> Staged:
    return stage([standing(block(), 0.03, 0.02)], orbit(8, 360, 30, 0.7))


@cache
def _true_mesh() -> ObjectMesh:
    """The exact mesh, finely divided, in its object frame."""
    truth = _staged().truth.subdivide_to_size(0.012)
    low, high = truth.bounds
    origin = np.array([0.5 * (low[0] + high[0]), SUPPORT, 0.5 * (low[2] + high[2])])
    gv_from_object = np.eye(4)
    gv_from_object[:3, 3] = origin
    return ObjectMesh(
        "block",
        (truth.vertices - origin).astype(np.float32),
        np.asarray(truth.faces, np.int32),
        colour_of(truth.vertices),
        np.ones(len(truth.vertices), bool),
        gv_from_object,
        True,
    )


def _size(mesh: ObjectMesh) -> float:
    return float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))


def _place(mesh: ObjectMesh, config: PlaceObject = QUICK) -> Placement:
    staged = _staged()
    return place(staged.reconstruction, staged.gravity_view, staged.masks, mesh, config)


def _error(placement: Placement, true_gv_from_object: np.ndarray) -> PlacementError:
    mesh = _true_mesh()
    return pose_error(placement.best.gv_from_object, true_gv_from_object, np.zeros(3), _size(mesh))


def _shifted(mesh: ObjectMesh, yaw_deg: float, scale: float, shift: np.ndarray) -> ObjectMesh:
    change = np.eye(4)
    change[:3, :3] = scale * yaw_gv(np.radians(yaw_deg))
    change[:3, 3] = shift
    return dataclasses.replace(mesh, gv_from_object=mesh.gv_from_object @ change)


def test_a_mesh_in_the_right_place_stays_there() -> None:
    placement = _place(_true_mesh())
    error = _error(placement, _true_mesh().gv_from_object)
    assert error.translation < 0.005 and error.yaw_deg < 0.5, error
    assert placement.verdict.status == "ok", placement.verdict
    assert placement.best.scores["mask_iou"] > 0.95


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_disturbed_pose_is_recovered(sign: float) -> None:
    mesh = _true_mesh()
    shift = 0.05 * _size(mesh) * np.array([0.7, -0.1, sign * 0.7])
    placement = _place(_shifted(mesh, sign * 15.0, 1.0 + sign * 0.05, shift))
    error = _error(placement, mesh.gv_from_object)
    assert error.translation < 0.01 and error.yaw_deg < 1.0, (error, placement.why)
    assert error.scale == pytest.approx(1.0, abs=0.01)
    assert placement.chosen != 0 and AS_MESHED in placement.why


@pytest.mark.parametrize(("yaw_deg", "scale"), [(137.0, 3.0), (-80.0, 0.2)])
def test_a_foreign_mesh_of_unknown_heading_and_size_is_placed(yaw_deg: float, scale: float) -> None:
    """As from an outside generator: upright, but with a heading and size of its own."""
    mesh = _true_mesh()
    turn = scale * yaw_gv(np.radians(yaw_deg))
    foreign = dataclasses.replace(
        mesh, vertices=(mesh.vertices @ turn.T).astype(np.float32), gv_from_object=np.eye(4)
    )
    placement = _place(foreign)
    undo = np.eye(4)
    undo[:3, :3] = np.linalg.inv(turn)
    error = _error(placement, mesh.gv_from_object @ undo)
    assert error.translation < 0.01 and error.yaw_deg < 1.0, (error, placement.why)
    assert error.scale == pytest.approx(1.0, abs=0.01)


def test_every_hypothesis_is_upright_and_scored() -> None:
    placement = _place(_shifted(_true_mesh(), 10.0, 1.0, np.zeros(3)))
    assert placement.hypotheses[0].name == AS_MESHED
    for hypothesis in placement.hypotheses:
        np.testing.assert_allclose(hypothesis.rotation_gv[:, 1], [0, 1, 0], atol=1e-9)
        assert np.linalg.det(hypothesis.rotation_gv) == pytest.approx(1.0)
        assert {"mask_iou", "depth_residual_m", "colour_rmse", "support_gap_m", "total"} <= set(
            hypothesis.scores
        )
    assert len({hypothesis.name for hypothesis in placement.hypotheses}) == len(
        placement.hypotheses
    )


@pytest.mark.parametrize("yaw_deg", [0.0, 4.0, 15.0])
def test_the_gate_never_picks_worse_than_as_meshed(yaw_deg: float) -> None:
    placement = _place(_shifted(_true_mesh(), yaw_deg, 1.0, np.zeros(3)))
    totals = [hypothesis.scores["total"] for hypothesis in placement.hypotheses]
    assert totals[placement.chosen] >= totals[0]
    if placement.chosen:
        assert totals[placement.chosen] == max(totals)
        assert totals[placement.chosen] - totals[0] >= QUICK.least_gain


def test_the_true_pose_scores_best() -> None:
    staged, mesh = _staged(), _true_mesh()
    seen = observe(staged.reconstruction, staged.gravity_view, staged.masks, 5, 1500)
    assert seen is not None
    comparison = Comparison(mesh, seen, SUPPORT)

    def total(moved: ObjectMesh) -> float:
        return comparison.scores(UprightPose.of(moved.gv_from_object), QUICK)["total"]

    for yaw, scale, shift in [(8, 1.0, 0.0), (0, 1.04, 0.0), (0, 1.0, 0.01)]:
        moved = _shifted(mesh, yaw, scale, np.array([shift, 0.0, 0.0]))
        assert total(moved) < total(mesh) - 0.01


def test_a_mesh_that_fits_nothing_is_degraded() -> None:
    mesh = _true_mesh()
    needle = mesh.vertices * np.array([0.02, 6.0, 0.02])
    wrong = dataclasses.replace(mesh, vertices=needle.astype(np.float32))
    placement = _place(wrong)
    assert placement.verdict.status == "degraded"
    assert "masks" in placement.verdict.reasons[0]


def test_an_unseen_object_cannot_be_placed() -> None:
    staged = _staged()
    empty = tuple(np.zeros_like(mask) for mask in staged.masks.masks)
    masks = dataclasses.replace(staged.masks, masks=empty)
    with pytest.raises(BadGeometry, match="not seen"):
        place(staged.reconstruction, staged.gravity_view, masks, _true_mesh(), QUICK)


def test_placing_twice_gives_the_same() -> None:
    mesh = _shifted(_true_mesh(), 6.0, 1.0, np.zeros(3))
    first, second = _place(mesh), _place(mesh)
    assert first.why == second.why
    np.testing.assert_array_equal(first.best.gv_from_object, second.best.gv_from_object)


@pytest.mark.parametrize("wrong", [{"max_views": 0}, {"pixels_per_view": 5}, {"yaw_starts": 0}])
def test_impossible_settings_are_refused(wrong: dict[str, int]) -> None:
    with pytest.raises(ValueError, match="got"):
        PlaceObject(**wrong)  # type: ignore[arg-type]
