"""Ask SAM-3D Objects for the whole of a masked object, with our own point map.

Given the point map, its mesh and pose come in the map's unit. Its layout optimisation is left
out: with a foreign point map it infers a negative focal length, and placement follows anyway.
The depth model that it would ask otherwise is not loaded.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, UInt8

from garden_models.foundation.failure import ModelFailed
from garden_models.foundation.imports import check_files, import_code
from garden_models.foundation.model_card import ModelCard, Terms, WeightFile
from garden_models.meshing.mesh_model import CompleteMesh, MeshAnswer, MeshRequest
from garden_models.meshing.sam3d_frames import (
    camera_from_mesh,
    mesh_in_our_frame,
    points_in_pytorch3d,
)
from garden_models.meshing.texture_sampling import sample_texture
from garden_models.scene import BadGeometry, BadInput

CARD = ModelCard(
    name="sam3d_objects",
    title="SAM-3D Objects",
    source="https://github.com/facebookresearch/sam-3d-objects",
    stage="mesh",
    terms=Terms(
        code="SAM License",
        weights="SAM License (no military use; passed on with its licence)",
        commercial=True,
    ),
    weights=(
        WeightFile("checkpoints/", "pipeline.yaml and all it names; of facebook/sam-3d-objects"),
        WeightFile("dinov2/", "a clone of facebookresearch/dinov2"),
        WeightFile(
            "torch_hub/checkpoints/dinov2_vitl14_reg4_pretrain.pth", "of facebookresearch/dinov2"
        ),
    ),
    imports=("sam3d_objects", "hydra", "omegaconf", "pytorch3d", "moge"),
    devices=("cuda",),
    install="clone the repository and follow its doc/setup.md, in an environment of its own",
    bfloat16=False,
)

LEAST_POINTS = 100
"""Fewer measured pixels of the object do not fix its scale."""

TRUSTED = {"sam3d_objects", "torch", "torchvision", "moge"}
"""The only packages whose classes a ``pipeline.yaml`` may name."""

DINO = "facebookresearch/dinov2"


def load(weights: Path, device: str) -> CompleteMesh:
    """Return what asks the model; BadInput if its code, its weights or a GPU is missing."""
    if not device.startswith("cuda"):
        raise BadInput(f"{CARD.title} runs on a CUDA GPU only, not on {device}")
    check_files(CARD, weights)
    os.environ.setdefault("CONDA_PREFIX", sys.prefix)
    os.environ["LIDRA_SKIP_INIT"] = "true"
    omegaconf = import_code(CARD, "omegaconf")
    hydra = import_code(CARD, "hydra.utils")
    import_code(CARD, "sam3d_objects.pipeline.inference_pipeline_pointmap")
    file = weights / "checkpoints" / "pipeline.yaml"
    if not file.is_file():
        raise BadInput(f"{CARD.title} needs {file}: put the published checkpoints there")
    config = omegaconf.OmegaConf.load(file)
    _refuse_foreign_classes(omegaconf.OmegaConf.to_container(config), file)
    config.rendering_engine = "pytorch3d"
    config.compile_model = False
    config.workspace_dir = str(file.parent)
    config.depth_model = None
    config.device = device
    with _on(device), _local_dino(weights):
        pipeline = hydra.instantiate(config)
    return Sam3dObjects(pipeline, device)


class Sam3dObjects:
    """Answers mesh requests with the published pipeline."""

    def __init__(self, pipeline: Any, device: str) -> None:
        self._pipeline = pipeline
        self._device = device

    def __call__(self, request: MeshRequest) -> MeshAnswer:
        """Return the completed mesh and where it is.

        Raises BadGeometry if too little of the object has depth, ModelFailed for no mesh.
        """
        measured = request.mask & np.isfinite(request.points_camera).all(axis=-1)
        if measured.sum() < LEAST_POINTS:
            raise BadGeometry(
                f"only {int(measured.sum())} pixels of the object have depth, too few for "
                f"{CARD.title} to tell its size; use a photo that shows it larger"
            )
        alpha = np.where(request.mask, 255, 0).astype(np.uint8)
        points = points_in_pytorch3d(request.points_camera).astype(np.float32)
        with _on(self._device):
            out = self._pipeline.run(
                np.concatenate([request.rgb, alpha[..., None]], axis=-1),
                None,
                request.seed,
                stage1_only=False,
                with_mesh_postprocess=False,
                with_texture_baking=False,
                with_layout_postprocess=False,
                use_vertex_color=True,
                pointmap=torch.from_numpy(np.ascontiguousarray(points)),
            )
        return mesh_answer(out)


def mesh_answer(out: dict[str, Any]) -> MeshAnswer:
    """Return the pipeline's answer in our conventions; ModelFailed if it is not a whole one."""
    mesh = out.get("glb")
    if mesh is None or len(mesh.faces) == 0:
        raise ModelFailed(f"{CARD.title} gave no mesh for the object")
    quaternion = _numbers(out, "rotation", 4)
    scales = _numbers(out, "scale", 3)
    if np.ptp(scales) > 1e-3 * scales.max() or scales.min() <= 0:
        raise ModelFailed(
            f"{CARD.title} must give three equal positive scales, got {scales.tolist()}"
        )
    if abs(float(np.linalg.norm(quaternion)) - 1.0) > 1e-2:
        raise ModelFailed(f"{CARD.title} must give a unit quaternion, got {quaternion.tolist()}")
    vertices = mesh_in_our_frame(np.asarray(mesh.vertices, np.float64))
    uv, texture = _texture(mesh)
    if uv is None or texture is None:
        rgb = np.asarray(mesh.visual.vertex_colors)[:, :3].astype(np.uint8)
    else:
        rgb = sample_texture(texture, uv)
    return MeshAnswer(
        vertices=vertices,
        faces=np.asarray(mesh.faces, np.int64),
        vertex_rgb=rgb,
        camera_from_mesh=camera_from_mesh(
            quaternion, _numbers(out, "translation", 3), float(scales.mean())
        ),
        uv=uv,
        texture=texture,
    )


def _texture(
    mesh: Any,
) -> tuple[Float[np.ndarray, "v 2"] | None, UInt8[np.ndarray, "h w 3"] | None]:
    """Return the mesh's texture coordinates (origin at the lower left) and picture, if any."""
    material = getattr(mesh.visual, "material", None)
    picture = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    if picture is None or getattr(mesh.visual, "uv", None) is None:
        return None, None
    return (
        np.asarray(mesh.visual.uv, np.float64),
        np.asarray(picture.convert("RGB"), np.uint8),
    )


def _numbers(out: dict[str, Any], name: str, count: int) -> Float[np.ndarray, " n"]:
    """Return a part of the pose as plain numbers; ModelFailed if it is not ``count`` of them."""
    value = out.get(name)
    if value is None:
        raise ModelFailed(f"{CARD.title} gave no {name} for the object")
    numbers = np.asarray(torch.as_tensor(value).detach().float().cpu(), np.float64).reshape(-1)
    if numbers.shape != (count,) or not np.isfinite(numbers).all():
        raise ModelFailed(
            f"{CARD.title} must give {count} numbers as {name}, got {numbers.tolist()}"
        )
    return numbers


def _refuse_foreign_classes(config: Any, path: Path) -> None:
    """Raise BadInput if a configuration would build anything but the model's own parts."""
    if isinstance(config, dict):
        target = config.get("_target_")
        if target is not None and str(target).split(".")[0] not in TRUSTED:
            raise BadInput(f"{path} asks for {target}, which is no part of {CARD.title}")
        for value in config.values():
            _refuse_foreign_classes(value, path)
    elif isinstance(config, list):
        for value in config:
            _refuse_foreign_classes(value, path)


def _on(device: str) -> AbstractContextManager[Any]:
    """Make the device current: parts of the pipeline name no device."""
    return torch.cuda.device(device) if torch.cuda.is_available() else nullcontext()


@contextmanager
def _local_dino(weights: Path) -> Iterator[None]:
    """Let the image encoder come from the weight folder: it asks GitHub by default."""
    load_from_hub, folder = torch.hub.load, torch.hub.get_dir()

    def load_local(repo_or_dir: str, model: str, *args: Any, **kwargs: Any) -> Any:
        if repo_or_dir == DINO:
            repo_or_dir = str(weights / "dinov2")
            kwargs["source"] = "local"
        return load_from_hub(repo_or_dir, model, *args, **kwargs)

    torch.hub.load = load_local
    torch.hub.set_dir(str(weights / "torch_hub"))
    try:
        yield
    finally:
        torch.hub.load = load_from_hub
        torch.hub.set_dir(folder)
