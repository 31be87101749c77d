"""SAM-3D Objects' adapter against a pipeline that answers the truth in its own conventions."""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
import torch

from garden_models.foundation.failure import ModelFailed
from garden_models.meshing import sam3d_objects
from garden_models.meshing.best_view import mesh_request
from garden_models.meshing.mesh_model import MeshAnswer, MeshRequest
from garden_models.meshing.sam3d_objects import Sam3dObjects, mesh_answer
from garden_models.scene import BadGeometry, BadInput
from tests.doubles.sam3d_pipeline import Sam3dPipeline
from tests.doubles.truth_scene import TruthScene, staged_scene
from tests.garden_models.meshing.staged import Staged, block, orbit, stage, standing


@cache
def staged() -> Staged:
    return stage([standing(block(), 0.03, 0.02)], orbit(3, 90, 30, 0.7))


@cache
def truth() -> TruthScene:
    return staged_scene(staged())


def request(unit: float = 1.0, view: int = 1) -> MeshRequest:
    one = mesh_request(staged().reconstruction.views[view], staged().masks.masks[view], 3)
    return MeshRequest(one.rgb, one.mask, one.points_camera * unit, one.seed)


def ask(pipeline: Sam3dPipeline, asked: MeshRequest | None = None) -> MeshAnswer:
    return Sam3dObjects(pipeline, "cpu")(asked or request())


def in_camera(answer: MeshAnswer) -> np.ndarray:
    pose = answer.camera_from_mesh
    return answer.vertices @ pose[:3, :3].T + pose[:3, 3]


def true_in_camera(view: int = 1) -> np.ndarray:
    pose = truth().camera_from_object(view, 0)
    return truth().bodies[0].vertices @ pose[:3, :3].T + pose[:3, 3]


@pytest.mark.parametrize("view", [0, 1, 2])
def test_the_mesh_comes_back_where_it_is(view: int) -> None:
    answer = ask(Sam3dPipeline(truth()), request(view=view))
    np.testing.assert_allclose(in_camera(answer), true_in_camera(view), atol=2e-3)


def test_it_is_in_the_unit_of_the_points() -> None:
    answer = ask(Sam3dPipeline(truth()), request(unit=0.3))
    np.testing.assert_allclose(in_camera(answer), 0.3 * true_in_camera(), atol=1e-3)


def test_it_is_upright_with_y_down_and_its_faces_outward() -> None:
    answer = ask(Sam3dPipeline(truth()))
    true = truth().bodies[0].vertices
    size = np.ptp(answer.vertices, axis=0)
    np.testing.assert_allclose(
        size / size.max(), np.ptp(true, axis=0) / np.ptp(true, axis=0).max(), atol=1e-6
    )
    lowest = true[:, 1] > true[:, 1].max() - 1e-6
    assert (answer.vertices[lowest, 1] == answer.vertices[:, 1].max()).all()
    a, b, c = (answer.vertices[answer.faces[:, i]] for i in range(3))
    assert np.einsum("fi,fi->", a, np.cross(b, c)) > 0


def test_colours_of_vertices_are_kept() -> None:
    answer = ask(Sam3dPipeline(truth()))
    assert answer.texture is None and answer.uv is None
    off = np.abs(answer.vertex_rgb.astype(int) - truth().bodies[0].rgb)
    assert off.max() <= 1


def test_a_texture_is_kept_with_its_coordinates() -> None:
    answer = ask(Sam3dPipeline(truth(), textured=True))
    assert answer.texture is not None and answer.uv is not None
    assert answer.uv.shape == (len(answer.vertices), 2)
    body = truth().bodies[0]
    shade = body.rgb[body.faces].mean(1).astype(int)
    found = answer.vertex_rgb.reshape(-1, 3, 3).astype(int)
    assert np.abs(found - shade[:, None]).max() <= 1


@pytest.mark.parametrize(
    "fault", ["quaternion_order", "up_axis", "transposed_rotation", "camera_axes", "other_unit"]
)
def test_with_any_convention_broken_it_comes_back_elsewhere(fault) -> None:
    answer = ask(Sam3dPipeline(truth(), fault=fault), request(view=0))
    away = np.linalg.norm(in_camera(answer) - true_in_camera(0), axis=1)
    assert away.max() > 0.05


def test_points_in_another_cameras_axes_would_not_be_taken() -> None:
    """The double looks at what it is given: OpenCV points without the turn are refused."""
    asked = request()
    flipped = MeshRequest(asked.rgb, asked.mask, asked.points_camera * [-1, -1, 1], 0)
    with pytest.raises(AssertionError, match="x left, y up"):
        ask(Sam3dPipeline(truth()), flipped)


def test_an_object_without_depth_is_not_asked_for() -> None:
    asked = request()
    blind = MeshRequest(asked.rgb, asked.mask, np.full_like(asked.points_camera, np.nan), 0)
    pipeline = Sam3dPipeline(truth())
    with pytest.raises(BadGeometry, match="0 pixels"):
        ask(pipeline, blind)
    assert pipeline.asked == 0


@pytest.mark.parametrize(
    ("part", "value", "said"),
    [
        ("glb", None, "no mesh"),
        ("rotation", torch.tensor([[0.5, 0.0, 0.0, 0.0]]), "unit quaternion"),
        ("rotation", torch.zeros(1, 3), "4 numbers"),
        ("scale", torch.tensor([[1.0, 1.0, 2.0]]), "equal positive"),
        ("scale", -torch.ones(1, 3), "equal positive"),
        ("translation", torch.full((1, 3), torch.nan), "3 numbers"),
        ("translation", None, "no translation"),
    ],
)
def test_an_answer_that_is_not_whole_is_refused(part, value, said) -> None:
    pipeline = Sam3dPipeline(truth())
    out = pipeline._answer(1, 0, 1.0)
    out[part] = value
    with pytest.raises(ModelFailed, match=said):
        mesh_answer(out)


class Built:
    """Stands for what hydra builds of a configuration; remembers it."""

    config: object = None


@pytest.fixture
def published(monkeypatch: pytest.MonkeyPatch) -> Built:
    """Stand-ins for the packages that only a GPU machine has."""
    built = Built()

    def instantiate(config):
        built.config = config
        built.hub_dir = torch.hub.get_dir()
        built.dino = torch.hub.load(
            repo_or_dir="facebookresearch/dinov2", model="tiny", source="github", verbose=False
        )
        return SimpleNamespace(run=None)

    hydra, utils = ModuleType("hydra"), ModuleType("hydra.utils")
    utils.instantiate = instantiate
    name = "sam3d_objects.pipeline.inference_pipeline_pointmap"
    for module in ("sam3d_objects", "sam3d_objects.pipeline", name):
        monkeypatch.setitem(sys.modules, module, ModuleType(module))
    monkeypatch.setitem(sys.modules, "hydra", hydra)
    monkeypatch.setitem(sys.modules, "hydra.utils", utils)
    return built


@pytest.fixture
def weights(tmp_path: Path) -> Path:
    for file in sam3d_objects.CARD.weights:
        path = tmp_path / file.path
        (path if file.path.endswith("/") else path.parent).mkdir(parents=True, exist_ok=True)
        if not file.path.endswith("/"):
            path.write_bytes(b"")
    (tmp_path / "dinov2" / "hubconf.py").write_text(
        "dependencies = []\ndef tiny(**kwargs):\n    return 'the local encoder'\n"
    )
    (tmp_path / "checkpoints" / "pipeline.yaml").write_text(
        "_target_: sam3d_objects.pipeline.inference_pipeline_pointmap.InferencePipelinePointMap\n"
        "depth_model: {_target_: moge.model.v1.MoGeModel.from_pretrained, name: Ruicheng/moge}\n"
        "compile_model: true\n"
    )
    return tmp_path


def test_it_is_built_offline_without_its_depth_model(published: Built, weights: Path) -> None:
    before = torch.hub.get_dir(), torch.hub.load
    assert isinstance(sam3d_objects.load(weights, "cuda"), Sam3dObjects)
    config = published.config
    assert config.depth_model is None and config.compile_model is False
    assert config.rendering_engine == "pytorch3d" and config.device == "cuda"
    assert config.workspace_dir == str(weights / "checkpoints")
    assert published.dino == "the local encoder"
    assert published.hub_dir == str(weights / "torch_hub")
    assert (torch.hub.get_dir(), torch.hub.load) == before


def test_a_configuration_that_builds_anything_else_is_refused(
    published: Built, weights: Path
) -> None:
    file = weights / "checkpoints" / "pipeline.yaml"
    file.write_text(file.read_text() + "extra: [{_target_: os.system, command: ls}]\n")
    with pytest.raises(BadInput, match=r"os\.system"):
        sam3d_objects.load(weights, "cuda")
    assert published.config is None


def test_what_is_missing_is_said(weights: Path, tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="CUDA GPU only"):
        sam3d_objects.load(weights, "cpu")
    with pytest.raises(BadInput, match="cannot be imported"):
        sam3d_objects.load(weights, "cuda")
    (weights / "checkpoints" / "pipeline.yaml").unlink()
    (weights / "torch_hub" / "checkpoints" / "dinov2_vitl14_reg4_pretrain.pth").unlink()
    with pytest.raises(BadInput, match="dinov2_vitl14_reg4_pretrain"):
        sam3d_objects.load(weights, "cuda")
