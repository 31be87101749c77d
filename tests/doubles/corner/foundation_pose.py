from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from garden_models.foundation.model_card import WeightFile
from garden_models.placement import foundation_pose
from garden_models.placement.pose_model import EstimatePose
from tests.doubles.corner import read_fault
from tests.doubles.foundation_pose_code import FoundationPoseCode
from tests.doubles.truth_scene import corner_scene

CARD = replace(
    foundation_pose.CARD, weights=(WeightFile("fault.txt"),), imports=(), devices=("cpu", "cuda")
)


def load(weights: Path, device: str) -> EstimatePose:
    fault = read_fault(weights)
    code = FoundationPoseCode(corner_scene(), fault=fault, knows_mesh=False)  # type: ignore[arg-type]
    return foundation_pose.FoundationPose(
        code, code.PoseRefinePredictor(), code.ScorePredictor(), "gl"
    )
