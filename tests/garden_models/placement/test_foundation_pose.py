"""FoundationPose's adapter against its module with a scene's truth in place of its networks."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
import torch

from garden_models.geometry.rigid import invert_rigid
from garden_models.geometry.rotation import rotation_angle_deg, yaw_gv
from garden_models.geometry.upright import tilt_deg
from garden_models.placement import foundation_pose
from garden_models.placement.foundation_pose import FoundationPose, integer_centres
from garden_models.placement.pose_model import PoseRequest
from garden_models.scene import BadGeometry, BadInput
from tests.doubles.foundation_pose_code import FoundationPoseCode
from tests.doubles.truth_scene import TruthScene, staged_scene
from tests.garden_models.meshing.staged import Staged, block, orbit, stage, standing

VIEW = 1


@cache
def staged() -> Staged:
    return stage([standing(block(), 0.03, 0.02)], orbit(3, 90, 30, 0.7))


@cache
def truth() -> TruthScene:
    return staged_scene(staged(), yaw_gv(0.7))


def model(**options) -> tuple[FoundationPose, FoundationPoseCode]:
    code = FoundationPoseCode(truth(), **options)
    return FoundationPose(code, code.PoseRefinePredictor(), code.ScorePredictor(), "gl"), code


def request(unit: float = 1.0, **changes) -> PoseRequest:
    view, body = staged().reconstruction.views[VIEW], truth().bodies[0]
    gv_from_camera = staged().gravity_view.gv_from_world @ invert_rigid(view.camera_from_world)
    asked = PoseRequest(
        rgb=view.rgb,
        depth=view.depth * unit,
        K=view.K,
        mask=staged().masks.masks[VIEW],
        vertices=body.vertices * unit,
        faces=body.faces,
        vertex_rgb=body.rgb,
        gv_from_camera=gv_from_camera[:3, :3],
    )
    return replace(asked, **changes)


def true_pose() -> np.ndarray:
    return truth().camera_from_object(VIEW, 0)


def error(pose: np.ndarray, unit: float = 1.0) -> tuple[float, float]:
    true = true_pose()
    turn = rotation_angle_deg(true[:3, :3].T @ pose[:3, :3])
    return turn, float(np.linalg.norm(pose[:3, 3] - unit * true[:3, 3]))


def test_the_upright_pose_is_the_true_one() -> None:
    answer = model(drift_deg=0.0)[0](request())
    turn, away = error(answer.camera_from_object[0])
    assert turn < 0.05 and away < 0.002
    assert (np.diff(answer.scores) <= 0).all()


@pytest.mark.parametrize("unit", [0.01, 7.0, 100.0])
def test_the_scenes_unit_does_not_matter(unit: float) -> None:
    """The model's own thresholds are in metres; the double refuses depth and mesh that are not."""
    answer = model(drift_deg=0.0)[0](request(unit))
    turn, away = error(answer.camera_from_object[0], unit)
    assert turn < 0.05 and away < 0.002 * unit


def test_all_upright_answers_are_upright_though_the_refiner_leans() -> None:
    for drift in (0.0, 3.0, 8.0):
        asked = request()
        answer = model(drift_deg=drift)[0](asked)
        for pose in answer.camera_from_object:
            assert tilt_deg(asked.gv_from_camera @ pose[:3, :3]) < 1e-4


def test_it_is_refined_one_iteration_at_a_time_from_all_headings() -> None:
    estimator, code = model()
    estimator(request(iterations=5))
    assert code.refinements == [36] * 5


def test_without_the_restriction_it_runs_as_published() -> None:
    estimator, code = model(drift_deg=3.0)
    asked = request(upright=False)
    answer = estimator(asked)
    assert code.refinements == [252]
    lean = tilt_deg(asked.gv_from_camera @ answer.camera_from_object[0][:3, :3])
    assert 0.5 < lean < 4.0
    assert error(answer.camera_from_object[0])[0] < 4.0


def test_a_second_mesh_takes_the_firsts_place() -> None:
    """The estimator is built once; its rotations come back for the free run."""
    estimator, code = model()
    first = estimator(request())
    middle = np.ptp(truth().bodies[0].vertices, axis=0) * [0.0, 0.5, 0.2]
    moved = estimator(request(vertices=truth().bodies[0].vertices + middle))
    shift = first.camera_from_object[0] @ [*-middle, 1.0]
    np.testing.assert_allclose(moved.camera_from_object[0][:3, 3], shift[:3], atol=1e-3)
    estimator(request(upright=False))
    assert code.refinements[-1] == 252


def test_only_poses_that_differ_are_kept() -> None:
    answer = model()[0](request(keep=3))
    assert 1 <= len(answer.scores) <= 3
    for i, a in enumerate(answer.camera_from_object):
        for b in answer.camera_from_object[:i]:
            turn = rotation_angle_deg(a[:3, :3].T @ b[:3, :3])
            assert turn > 5 or np.linalg.norm(a[:3, 3] - b[:3, 3]) > 0.01


def test_the_process_keeps_its_usual_tensors() -> None:
    """The published refiner makes the GPU the default of the whole process."""
    for upright in (True, False):
        model()[0](request(upright=upright))
        assert torch.zeros(1).dtype == torch.float32


def test_pixel_centres_are_whole_numbers_there() -> None:
    K = np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]])
    point = np.array([0.1, -0.05, 2.0])
    ours = K @ point / point[2]
    theirs = integer_centres(K) @ point / point[2]
    np.testing.assert_allclose(theirs[:2], ours[:2] - 0.5)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"K": None}, "whole numbers"),
        ({"vertices": None}, "unit"),
    ],
)
def test_the_double_refuses_what_the_model_would_misread(changes, said) -> None:
    """Centres off by a pixel, a mesh of another unit than the depth."""
    asked = request()
    if "K" in changes:
        changes = {"K": asked.K + np.array([[0, 0, 1.0], [0, 0, 1.0], [0, 0, 0]])}
    else:
        changes = {"vertices": asked.vertices * 2.0}
    with pytest.raises(AssertionError, match=said):
        model()[0](replace(asked, **changes))


def test_an_object_without_depth_has_no_pose() -> None:
    with pytest.raises(BadGeometry, match="0 pixels"):
        model()[0](request(depth=np.zeros_like(request().depth)))


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    for file in foundation_pose.CARD.weights:
        path = tmp_path / file.path
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("")
    return tmp_path


def published(monkeypatch: pytest.MonkeyPatch, **parts) -> None:
    """Stand-ins for the packages that only a GPU machine has."""
    rasteriser = ModuleType("nvdiffrast.torch")
    rasteriser.RasterizeCudaContext = lambda: "gl"
    monkeypatch.setitem(sys.modules, "nvdiffrast", ModuleType("nvdiffrast"))
    monkeypatch.setitem(sys.modules, "nvdiffrast.torch", rasteriser)
    code = ModuleType("estimater")
    complete = {
        "mycpp": object(), "erode_depth": print, "bilateral_filter_depth": print,
        "PoseRefinePredictor": SimpleNamespace, "ScorePredictor": SimpleNamespace,
    }  # fmt: skip
    for name, part in {**complete, **parts}.items():
        setattr(code, name, part)
    monkeypatch.setitem(sys.modules, "estimater", code)


def test_it_is_found_in_its_clone(monkeypatch: pytest.MonkeyPatch, clone: Path) -> None:
    published(monkeypatch)
    path = list(sys.path)
    assert isinstance(foundation_pose.load(clone, "cuda"), FoundationPose)
    assert sys.path == path


def test_its_weight_files_may_hold_tensors_only(
    monkeypatch: pytest.MonkeyPatch, clone: Path
) -> None:
    class Trap:
        def __reduce__(self):
            return (print, ("a weight file ran code",))

    file = clone / "weights" / "2023-10-28-18-33-37" / "model_best.pth"
    torch.save({"model": Trap()}, file)

    def predictor() -> object:
        return torch.load(file, weights_only=False)

    published(monkeypatch, PoseRefinePredictor=predictor)
    with pytest.raises(BadInput, match="does not hold"):
        foundation_pose.load(clone, "cuda")


@pytest.mark.parametrize(("part", "said"), [("mycpp", "mycpp"), ("erode_depth", "warp")])
def test_a_half_built_clone_is_refused(
    monkeypatch: pytest.MonkeyPatch, clone: Path, part: str, said: str
) -> None:
    published(monkeypatch, **{part: None})
    with pytest.raises(BadInput, match=said):
        foundation_pose.load(clone, "cuda")


def test_an_extension_that_is_installed_is_as_good_as_one_in_the_clone(
    monkeypatch: pytest.MonkeyPatch, clone: Path
) -> None:
    """The environment's recipe builds it once, for any clone."""
    extension = ModuleType("mycpp")
    extension.cluster_poses = print
    monkeypatch.setitem(sys.modules, "mycpp", extension)
    published(monkeypatch, mycpp=None)
    assert isinstance(foundation_pose.load(clone, "cuda"), FoundationPose)
    assert sys.modules["estimater"].mycpp is extension


def test_what_is_missing_is_said(clone: Path) -> None:
    with pytest.raises(BadInput, match="CUDA GPU only"):
        foundation_pose.load(clone, "cpu")
    with pytest.raises(BadInput, match=r"nvdiffrast\.torch"):
        foundation_pose.load(clone, "cuda")
    (clone / "weights" / "2024-01-11-20-02-45" / "model_best.pth").unlink()
    with pytest.raises(BadInput, match=r"2024-01-11.*the scorer"):
        foundation_pose.load(clone, "cuda")
