from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from garden_models.foundation.model_card import WeightFile
from garden_models.segmentation import sam2
from garden_models.segmentation.box_prompt import BoxPrompter
from garden_models.segmentation.mask_model import MaskBoxes
from tests.doubles.corner import read_fault
from tests.doubles.promptable_network import PromptableNetwork
from tests.doubles.truth_scene import corner_scene

CARD = replace(sam2.CARD, weights=(WeightFile("fault.txt"),), imports=())


def load(weights: Path, device: str) -> MaskBoxes:
    everything = read_fault(weights) == "everything"
    imagenet = np.array([0.485, 0.456, 0.406]), np.array([0.229, 0.224, 0.225])
    network = PromptableNetwork(corner_scene(), *imagenet, everything=everything)
    return BoxPrompter(network, device, sam2.MEAN, sam2.STD)
