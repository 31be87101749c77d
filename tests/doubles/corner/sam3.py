from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from garden_models.foundation.model_card import WeightFile
from garden_models.segmentation import sam3_tracker
from garden_models.segmentation.box_prompt import BoxPrompter
from garden_models.segmentation.mask_model import MaskBoxes
from tests.doubles.corner import read_fault
from tests.doubles.promptable_network import PromptableNetwork
from tests.doubles.truth_scene import corner_scene

CARD = replace(sam3_tracker.CARD, weights=(WeightFile("fault.txt"),), imports=())


def load(weights: Path, device: str) -> MaskBoxes:
    everything = read_fault(weights) == "everything"
    network = PromptableNetwork(corner_scene(), 0.5, 0.5, everything=everything)
    return BoxPrompter(network, device, sam3_tracker.MEAN, sam3_tracker.STD)
