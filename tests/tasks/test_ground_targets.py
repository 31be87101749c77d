"""Targets by name as a step: its own weights, through the door that all models share."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from garden_models.scene import Capture, Photo
from garden_models.targets.boxes import validate
from garden_models.targets.config import GroundTargets
from garden_models.targets.proposal import TargetProposal
from storage import Store
from tasks.ground_targets import ground_targets
from tasks.model.resident import residents
from tasks.step import Ref, RunContext, StepFailed, load, run_context
from tests.garden_models.targets.tiny_grounding_dino import save_tiny

RGB = np.random.default_rng(0).integers(0, 256, (60, 90, 3)).astype(np.uint8)
CAPTURE = Capture(tuple(Photo(f"{name}.jpg", RGB, (900, 600)) for name in "ab"))
CONFIG = GroundTargets(model="grounding_dino", labels=("red mug", "chair"), min_score=0.0)


@pytest.fixture
def weights(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("CONFIG", "CACHE"):
        monkeypatch.setenv(f"XDG_{name}_HOME", str(tmp_path / name))
    monkeypatch.setenv("GARDEN_WEIGHTS", str(tmp_path / "weights"))
    monkeypatch.delenv("GARDEN_MODELS", raising=False)
    residents.free()
    return tmp_path / "weights" / "grounding_dino"


def run(tmp_path: Path, config: GroundTargets = CONFIG) -> tuple[Ref, TargetProposal]:
    context = RunContext(Store.open(tmp_path / "store", durability="none"), "desk")
    with run_context(context):
        ref = ground_targets(CAPTURE, ("b.jpg",), config)
        return ref, load(ref, TargetProposal)


@pytest.mark.slow
def test_a_saved_network_gives_targets_that_pass_as_boxes_by_hand(
    weights: Path, tmp_path: Path
) -> None:
    save_tiny(weights)
    ref, found = run(tmp_path)
    assert ref.backend == "grounding_dino"
    assert found.targets
    assert {target.photo for target in found.targets} == {"a.jpg"}
    validate(found.targets, {"a.jpg": (900, 600)})
    assert len(found.scores) == len(found.targets)
    assert run(tmp_path)[0].outcome == "cached"
    (weights / "tokenizer_config.json").write_text("{}")
    assert run(tmp_path)[0].outcome == "executed"


def test_missing_weights_say_where_they_go(weights: Path, tmp_path: Path) -> None:
    with pytest.raises(StepFailed) as caught:
        run(tmp_path)
    assert f"put them at {weights / 'config.json'}" in caught.value.reason
    assert "IDEA-Research/grounding-dino-tiny" in caught.value.reason
