"""FoundationPose's poses, the mesh's own and ours in one gate; what leans is seen."""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest

from garden_models.geometry.rotation import axis_angle, yaw_gv
from garden_models.geometry.upright import tilt_deg
from garden_models.metrics.placement import PlacementError, pose_error
from garden_models.placement.config import PlaceObject
from garden_models.placement.foundation_pose import FoundationPose
from garden_models.placement.model_poses import FREE, UPRIGHT
from garden_models.placement.place import AS_MESHED, place
from garden_models.scene import BadGeometry, ObjectMesh, Placement
from tests.doubles.foundation_pose_code import FoundationPoseCode
from tests.doubles.truth_scene import TruthScene, staged_scene
from tests.garden_models.meshing.staged import Staged, block, orbit, stage, standing

CONFIG = PlaceObject(method="foundation_pose", max_views=4, pixels_per_view=1000, yaw_starts=12)


@cache
def staged() -> Staged:
    return stage([standing(block(), 0.03, 0.02)], orbit(6, 360, 30, 0.7))


@cache
def truth() -> TruthScene:
    return staged_scene(staged())


def true_mesh(gv_from_object: np.ndarray | None = None) -> ObjectMesh:
    body = truth().bodies[0]
    pose = staged().gravity_view.gv_from_world @ body.world_from_object
    return ObjectMesh(
        "block",
        body.vertices.astype(np.float32),
        np.asarray(body.faces, np.int32),
        body.rgb,
        np.ones(len(body.vertices), bool),
        pose if gv_from_object is None else gv_from_object,
        True,
    )


def moved(turn: np.ndarray, shift: tuple[float, float, float]) -> ObjectMesh:
    pose = true_mesh().gv_from_object.copy()
    pose[:3, :3] = turn @ pose[:3, :3]
    pose[:3, 3] += shift
    return true_mesh(pose)


def run(mesh: ObjectMesh, config: PlaceObject = CONFIG, **options) -> Placement:
    code = FoundationPoseCode(truth(), **options)
    estimate = FoundationPose(code, code.PoseRefinePredictor(), code.ScorePredictor(), "gl")
    one = staged()
    return place(one.reconstruction, one.gravity_view, one.masks, mesh, config, estimate=estimate)


def error(placement: Placement) -> PlacementError:
    mesh = true_mesh()
    size = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    return pose_error(placement.best.gv_from_object, mesh.gv_from_object, np.zeros(3), size)


def names(placement: Placement) -> list[str]:
    return [one.name for one in placement.hypotheses]


def test_all_kinds_of_hypotheses_meet_in_the_gate() -> None:
    placement = run(moved(yaw_gv(1.2), (0.05, 0.0, -0.06)))
    found = names(placement)
    assert found[0] == AS_MESHED
    for kind in (UPRIGHT, FREE, "refined translation", "heading"):
        assert any(name.startswith(kind) for name in found), (kind, found)
    for one in placement.hypotheses:
        assert {"mask_iou", "depth_residual_m", "support_gap_m", "tilt_deg", "total"} <= set(
            one.scores
        )
    assert error(placement).translation < 0.01 and error(placement).yaw_deg < 1.0
    assert placement.verdict.status == "ok", placement.verdict


def test_the_winner_is_upright_even_if_the_free_model_leans() -> None:
    placement = run(moved(yaw_gv(1.2), (0.05, 0.0, -0.06)), drift_deg=3.0)
    assert tilt_deg(placement.best.rotation_gv) < 1e-4
    free = [one for one in placement.hypotheses if one.name.startswith(FREE)]
    assert max(one.scores["tilt_deg"] for one in free) > 0.5
    upright = [one for one in placement.hypotheses if one.name.startswith(UPRIGHT)]
    assert max(one.scores["tilt_deg"] for one in upright) < 1e-4


def test_without_gravity_only_free_rotations_are_asked_for() -> None:
    config = dataclasses.replace(CONFIG, rotations="free")
    found = names(run(moved(yaw_gv(1.2), (0.05, 0.0, -0.06)), config))
    assert any(n.startswith(FREE) for n in found) and not any(n.startswith(UPRIGHT) for n in found)


def test_the_full_pose_is_taken_as_it_is_and_its_lean_is_seen() -> None:
    config = dataclasses.replace(CONFIG, rotations="free", gate=False)
    placement = run(moved(yaw_gv(1.2), (0.05, 0.0, -0.06)), config, drift_deg=3.0)
    assert names(placement) == [AS_MESHED, f"{FREE}, 1"] and placement.chosen == 1
    assert "without the gate" in placement.why
    assert any("leans by" in reason for reason in placement.verdict.reasons)
    assert placement.verdict.status == "ok"
    leaning = run(moved(yaw_gv(1.2), (0.05, 0.0, -0.06)), config, drift_deg=25.0)
    assert tilt_deg(leaning.best.rotation_gv) > config.most_tilt_deg
    assert leaning.verdict.status == "degraded"


def test_a_mesh_whose_own_pose_leans_is_placed_upright() -> None:
    leaning = moved(axis_angle(np.array([1.0, 0.0, 0.3]), np.radians(8.0)), (0.0, 0.0, 0.0))
    placement = run(leaning)
    assert placement.hypotheses[0].scores["tilt_deg"] == pytest.approx(8.0, abs=0.01)
    assert any("made upright" in name for name in names(placement))
    assert tilt_deg(placement.best.rotation_gv) < 1e-4
    assert error(placement).translation < 0.01 and error(placement).yaw_deg < 1.0


def test_of_poses_as_good_the_upright_one_is_kept() -> None:
    leaning = moved(axis_angle(np.array([1.0, 0.0, 0.3]), np.radians(0.2)), (0.0, 0.0, 0.0))
    placement = run(leaning)
    assert placement.chosen != 0 and tilt_deg(placement.best.rotation_gv) < 1e-4
    assert not any("leans" in reason for reason in placement.verdict.reasons)


def test_leaning_costs_as_much_as_the_setting_says() -> None:
    leaning = moved(axis_angle(np.array([1.0, 0.0, 0.3]), np.radians(8.0)), (0.0, 0.0, 0.0))
    totals = [
        run(leaning, dataclasses.replace(CONFIG, tilt_weight=weight)).hypotheses[0].scores["total"]
        for weight in (0.0, 2.0)
    ]
    assert totals[0] - totals[1] == pytest.approx(2.0 * 8.0 / 90.0, abs=1e-3)


@pytest.mark.parametrize("fault", ["camera_axes", "transposed_rotation", "other_unit"])
def test_a_broken_convention_is_not_ok(fault) -> None:
    placement = run(moved(yaw_gv(1.2), (0.05, 0.0, -0.06)), fault=fault)
    assert placement.verdict.status == "degraded", placement.why
    assert "FoundationPose" in "; ".join(placement.verdict.reasons)


def test_a_model_that_gives_no_pose_is_said_and_ours_is_taken() -> None:
    def silent(request):
        raise BadGeometry("no depth at all")

    one = staged()
    mesh = moved(yaw_gv(0.3), (0.02, 0.0, 0.0))
    placement = place(
        one.reconstruction, one.gravity_view, one.masks, mesh, CONFIG, estimate=silent
    )
    assert placement.verdict.status == "degraded"
    assert "no depth at all" in placement.verdict.reasons[0]
    assert error(placement).translation < 0.01


def test_the_method_needs_the_model() -> None:
    one = staged()
    with pytest.raises(ValueError, match="foundation_pose"):
        place(one.reconstruction, one.gravity_view, one.masks, true_mesh(), CONFIG)
