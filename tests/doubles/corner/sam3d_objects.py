from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from garden_models.foundation.model_card import WeightFile
from garden_models.meshing import sam3d_objects
from garden_models.meshing.mesh_model import CompleteMesh
from tests.doubles.corner import read_fault
from tests.doubles.sam3d_pipeline import Sam3dPipeline
from tests.doubles.truth_scene import corner_scene

CARD = replace(
    sam3d_objects.CARD, weights=(WeightFile("fault.txt"),), imports=(), devices=("cpu", "cuda")
)


def load(weights: Path, device: str) -> CompleteMesh:
    pipeline = Sam3dPipeline(corner_scene(), fault=read_fault(weights))  # type: ignore[arg-type]
    return sam3d_objects.Sam3dObjects(pipeline, device)
