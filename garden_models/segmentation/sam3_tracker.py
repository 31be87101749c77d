"""Ask SAM-3 for the object in a box, by its tracker: one box, that instance.

Its concept model takes a box as an example and returns every object like it (each chair of a
row), which is not what a target is; only the tracker is used here. Its weights are part of
the published video checkpoint, of which the rest is left aside.
"""

from __future__ import annotations

from pathlib import Path

from garden_models.foundation.model_card import ModelCard, Terms, WeightFile
from garden_models.segmentation.box_prompt import load_promptable
from garden_models.segmentation.mask_model import MaskBoxes

MEAN = STD = (0.5, 0.5, 0.5)

CARD = ModelCard(
    name="sam3",
    title="SAM-3 (tracker)",
    source="https://huggingface.co/facebook/sam3",
    stage="segment",
    terms=Terms(
        code="Apache-2.0 (transformers)",
        weights="SAM License (no military use; passed on with its licence)",
        commercial=True,
    ),
    weights=(
        WeightFile("config.json", "of facebook/sam3, after accepting its licence"),
        WeightFile("model.safetensors", "of facebook/sam3, after accepting its licence"),
    ),
    imports=("transformers",),
    install="pip install 'transformers>=5.23'",
)


def load(weights: Path, device: str) -> MaskBoxes:
    """Return what asks the tracker; BadInput if its code or its weights are missing."""
    return load_promptable(CARD, "Sam3TrackerModel", weights, device, MEAN, STD)
