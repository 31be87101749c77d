"""Depth-Anything-3 in the sizes whose weights may be used commercially."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from garden_models.foundation.model_card import WeightFile
from garden_models.reconstruction import depth_anything_3
from garden_models.reconstruction.da3_memory import memory_need
from garden_models.reconstruction.da3_network import model_name
from garden_models.reconstruction.geometry_model import PredictGeometry
from garden_models.scene import BadInput

__all__ = ["CARD", "load", "memory_need"]

PERMISSIVE = ("da3-small", "da3-base", "da3metric-large")

CARD = replace(
    depth_anything_3.CARD,
    name="depth_anything_3_base",
    title="Depth-Anything-3 (small, base, metric)",
    weights_licence="Apache-2.0",
    commercial=True,
    weights=(
        WeightFile("config.json", "depth-anything/DA3-BASE, DA3-SMALL or DA3METRIC-LARGE"),
        WeightFile("model.safetensors"),
    ),
)


def load(weights: Path, device: str) -> PredictGeometry:
    """Return the model; raise BadInput as ``depth_anything_3``, and for other weights."""
    kind = model_name(weights)
    if kind not in PERMISSIVE:
        raise BadInput(
            f"{weights}: the weights of {kind} are not for commercial use; {CARD.name} takes "
            f"{', '.join(PERMISSIVE)} only: use depth_anything_3 for others"
        )
    return depth_anything_3.load(weights, device)
