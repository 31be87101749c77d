"""An environment in which the paper's models are installed, their networks the scene's truth.

The adapters are GARDEN's own: they find their weight folders, read them, import the published
packages and call them. The packages are doubles that check what they are given and answer the
sample capture's truth in the model's own convention, or with one convention broken: which one
is part of the weights, so that other weights are another model to the store.

    with installed(folder) as models:
        models.put("sam3d_objects", "quaternion_order")
"""

from __future__ import annotations

import importlib.util
import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import torch
from safetensors.torch import save_file

from garden_models.placement import foundation_pose
from garden_models.reconstruction import da3_photos
from tasks.model import settings
from tasks.model.keeper_client import VARIABLE as KEEPER
from tasks.model.resident import residents
from tasks.step import budget
from tests.doubles import depth_anything_3, python_with_models
from tests.doubles.foundation_pose_code import FoundationPoseCode
from tests.doubles.promptable_network import PromptableNetwork
from tests.doubles.sam3d_pipeline import Sam3dPipeline
from tests.doubles.true_views import TrueViews
from tests.doubles.truth_scene import corner_scene

DA3 = "da3nested-giant-large"
DA3_FAULTS = ("", "transposed_camera", "world_from_camera", "depth_unit", "unscaled_gaussians")
MODELS = ("depth_anything_3", "sam3", "sam3d_objects", "foundation_pose")
PIPELINE = "sam3d_objects.pipeline.inference_pipeline_pointmap"
ESTIMATER = """\
from tests.doubles.published_code import estimater_names

globals().update(estimater_names(__file__))
"""
SETTINGS = """\
[depth_anything_3]
device = "cpu"
[sam3]
device = "cpu"
"""


@dataclass(frozen=True)
class Models:
    """The weight folders of all models, below ``folder``."""

    folder: Path

    def put(self, name: str, fault: str = "") -> None:
        """Write a model's weights: those of the published one, or of one with a fault."""
        place = self.folder / name
        place.mkdir(exist_ok=True)
        {
            "depth_anything_3": _put_da3,
            "sam3": _put_sam3,
            "sam3d_objects": _put_sam3d,
            "foundation_pose": _put_foundation_pose,
        }[name](place, fault)


@contextmanager
def installed(folder: Path, long_side: int) -> Iterator[Models]:
    """Install all of them, with sound weights below ``folder``, on a machine with a GPU.

    They run in this process, but for what needs one of its own. ``long_side`` is that of
    Depth-Anything-3's pictures.
    """
    own_process = f"[foundation_pose]\npython = {_python(long_side)}\n"
    with _machine(folder, SETTINGS + own_process) as (models, patch):
        patch.setenv(KEEPER, "off")
        patch.setattr(settings, "_torch_has_gpus", lambda: True)
        patch.setattr(da3_photos, "LONG_SIDE", long_side)
        patch.setattr(depth_anything_3, "LONG_SIDE", long_side)
        for name, module in _packages().items():
            patch.setitem(sys.modules, name, module)
        residents.free()
        yield models
        residents.free()
        sys.modules.pop("estimater", None)


@contextmanager
def installed_in_workers(folder: Path, long_side: int) -> Iterator[Models]:
    """The same, but each in another environment than this one's, where workers run it."""
    python = _python(long_side)
    here = SETTINGS.replace('device = "cpu"', f'device = "cpu"\npython = {python}')
    here += "".join(
        f"[{name}]\npython = {python}\n" for name in ("sam3d_objects", "foundation_pose")
    )
    with _machine(folder, here) as (models, patch):
        patch.delenv(KEEPER, raising=False)
        patch.setattr(budget, "usable_gpus", lambda: ("0",))
        patch.setattr(da3_photos, "LONG_SIDE", long_side)  # of the memory that it will need
        yield models


@contextmanager
def _machine(folder: Path, model_settings: str) -> Iterator[tuple[Models, pytest.MonkeyPatch]]:
    models = Models(folder / "weights")
    models.folder.mkdir()
    for name in MODELS:
        models.put(name)
    (folder / "models.toml").write_text(model_settings)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("GARDEN_WEIGHTS", str(models.folder))
        patch.setenv("GARDEN_MODELS", str(folder / "models.toml"))
        patch.setattr(settings, "usable_gpus", lambda: ("0",))
        patch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
        yield models, patch


def _python(long_side: int) -> str:
    return json.dumps([sys.executable, python_with_models.__file__, str(long_side)])


def install_packages(long_side: int) -> None:
    """Install all of them in this process, for good."""
    da3_photos.LONG_SIDE = depth_anything_3.LONG_SIDE = long_side
    sys.modules.update(_packages())


def _packages() -> dict[str, ModuleType]:
    """Return the modules that the adapters import, and empty ones that must only be there."""
    modules = [
        _module("depth_anything_3"),
        _module("depth_anything_3.cfg", load_config=dict, create_object=lambda config: Da3()),
        _module("depth_anything_3.registry", MODEL_REGISTRY={DA3: {}}),
        _module("depth_anything_3.model"),
        _module(
            "depth_anything_3.model.reference_view_selector",
            select_reference_view=lambda tokens, strategy: torch.tensor([2]),
        ),
        _module("transformers", Sam3TrackerModel=Sam3Tracker),
        _module("sam3d_objects"),
        _module("sam3d_objects.pipeline"),
        _module(PIPELINE, InferencePipelinePointMap=_sam3d_pipeline),
        _module("hydra"),
        _module("hydra.utils", instantiate=_instantiate),
        _module("nvdiffrast"),
        _module("nvdiffrast.torch", RasterizeCudaContext=object),
    ]
    names = ("evo", "e3nn", "pytorch3d", "moge", "kornia", "warp", "mycpp", "open3d", "addict")
    modules += [_module(name) for name in (*names, "einops") if not importlib.util.find_spec(name)]
    return {module.__name__: module for module in modules}


def _module(name: str, **members: Any) -> ModuleType:
    module = ModuleType(name)
    module.__spec__ = ModuleSpec(name, None)
    module.__dict__.update(members)
    return module


class CornerViews(TrueViews):
    """The sample capture's photos; depth is cast at the very pixels of a model's picture."""

    def depth_at(self, index: int, K_model: np.ndarray, size: tuple[int, int]) -> np.ndarray:
        np.testing.assert_allclose(K_model, corner_scene().cameras[index].scaled_K(size), atol=1e-6)
        return corner_scene().picture(index, size).depth.astype(np.float32)


@lru_cache(maxsize=1)
def corner_views() -> CornerViews:
    cameras = corner_scene().cameras
    return CornerViews(
        tuple(camera.rgb for camera in cameras),
        (),
        np.stack([camera.K for camera in cameras]),
        np.stack([camera.camera_from_world[:3] for camera in cameras]),
    )


class Da3(depth_anything_3.Nested):
    """The nested network; its one parameter says which convention it breaks."""

    def __init__(self) -> None:
        super().__init__(corner_views(), unit=2.5, transposed=False, unscaled=False)

    def forward(self, *args: Any, **kwargs: Any) -> dict[str, Any]:
        fault = DA3_FAULTS[int(self.da3.anything)]
        self.da3.transposed = fault == "transposed_camera"
        self.unscaled = fault == "unscaled_gaussians"
        out = super().forward(*args, **kwargs)
        if fault == "world_from_camera":
            whole = torch.eye(4).repeat(1, out["extrinsics"].shape[1], 1, 1)
            whole[:, :, :3] = out["extrinsics"]
            out["extrinsics"] = torch.linalg.inv(whole)[:, :, :3]
        if fault == "depth_unit":
            out["depth"] = out["depth"] / self.unit
        if "gaussians" in out:
            _thin(out["gaussians"])
        return out


def _thin(gaussians: Any, every: int = 4) -> None:
    """Let all but one Gaussian in some be invisible: a test has no use for millions."""
    fainter = torch.arange(gaussians.opacities.shape[1]) % every != 0
    gaussians.opacities[:, fainter] = 0.0


def _put_da3(place: Path, fault: str) -> None:
    (place / "config.json").write_text(json.dumps({"model_name": DA3}))
    value = torch.tensor([float(DA3_FAULTS.index(fault))])
    save_file({"model.da3.anything": value}, place / "model.safetensors")


class Sam3Tracker(PromptableNetwork):
    """The class of transformers."""

    @classmethod
    def from_pretrained(
        cls, weights: Path, local_files_only: bool, output_loading_info: bool, dtype: torch.dtype
    ) -> tuple[Sam3Tracker, dict[str, list[str]]]:
        assert local_files_only and output_loading_info and dtype == torch.float32
        fault = json.loads((weights / "config.json").read_text())["fault"]
        network = cls(corner_scene(), everything=fault == "everything")
        return network, {"missing_keys": [], "mismatched_keys": []}

    def to(self, device: str) -> Sam3Tracker:
        return self

    def eval(self) -> Sam3Tracker:
        return self


def _put_sam3(place: Path, fault: str) -> None:
    (place / "config.json").write_text(json.dumps({"fault": fault}))
    save_file({"anything": torch.zeros(1)}, place / "model.safetensors")


def _instantiate(config: Any) -> Any:
    """As hydra does: what ``_target_`` names, called with the rest."""
    module, _, name = config.pop("_target_").rpartition(".")
    return getattr(sys.modules[module], name)(**config)


def _sam3d_pipeline(
    fault: str,
    rendering_engine: str,
    compile_model: bool,
    workspace_dir: str,
    depth_model: None,
    device: str,
) -> Sam3dPipeline:
    assert rendering_engine == "pytorch3d" and not compile_model and depth_model is None
    assert Path(workspace_dir).is_dir() and device == "cuda"
    return Sam3dPipeline(corner_scene(), fault=fault)  # type: ignore[arg-type]


def _put_sam3d(place: Path, fault: str) -> None:
    for folder in ("checkpoints", "dinov2", "torch_hub/checkpoints"):
        (place / folder).mkdir(parents=True, exist_ok=True)
    named = f"_target_: {PIPELINE}.InferencePipelinePointMap\nfault: '{fault}'\n"
    (place / "checkpoints" / "pipeline.yaml").write_text(named)
    (place / "dinov2" / "hubconf.py").write_text("")
    (place / "torch_hub" / "checkpoints" / "dinov2_vitl14_reg4_pretrain.pth").write_bytes(b"")


def estimater_names(file: str) -> dict[str, Any]:
    """Return the names of the module ``estimater``, which lies in the folder of the weights."""
    refiner = next(f for f in foundation_pose.CARD.weights if f.note == "the refiner")
    fault = json.loads(Path(file).with_name("weights").parent.joinpath(refiner.path).read_text())
    code = FoundationPoseCode(corner_scene(), fault=fault["fault"], knows_mesh=False)
    names = (
        "FoundationPose", "ScorePredictor", "PoseRefinePredictor", "mycpp", "erode_depth",
        "bilateral_filter_depth", "depth2xyzmap",
    )  # fmt: skip
    return {name: getattr(code, name) for name in names}


def _put_foundation_pose(place: Path, fault: str) -> None:
    for file in foundation_pose.CARD.weights:
        path = place / file.path
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps({"fault": fault}))
    (place / "estimater.py").write_text(ESTIMATER)
    sys.modules.pop("estimater", None)
