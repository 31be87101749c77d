"""Ask SAM-2 for the object in a box: permissive code and weights, for any of its sizes."""

from __future__ import annotations

from pathlib import Path

from garden_models.foundation.model_card import ModelCard, Terms, WeightFile
from garden_models.segmentation.box_prompt import load_promptable
from garden_models.segmentation.mask_model import MaskBoxes

MEAN, STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)

CARD = ModelCard(
    name="sam2",
    title="SAM-2",
    source="https://huggingface.co/facebook/sam2.1-hiera-large",
    stage="segment",
    terms=Terms(code="Apache-2.0 (transformers)", weights="Apache-2.0", commercial=True),
    weights=(
        WeightFile("config.json", "of facebook/sam2.1-hiera-large or a smaller one"),
        WeightFile("model.safetensors", "of the same"),
    ),
    imports=("transformers",),
    install="pip install 'transformers>=5.23'",
)


def load(weights: Path, device: str) -> MaskBoxes:
    """Return what asks the model; BadInput if its code or its weights are missing."""
    return load_promptable(CARD, "Sam2Model", weights, device, MEAN, STD)
