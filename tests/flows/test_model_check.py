"""A model that is missing, or not allowed, ends a run before any work, in one sentence."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from PIL import Image

from flows.command import main
from flows.model_check import check_runnable, check_weights
from flows.preset import PRESETS, Preset
from garden_models.foundation import card
from garden_models.scene import BadInput
from tasks.step import PlanEntry, Ref
from tasks.step.ref import Why
from tests.doubles.published_code import MODELS, Models, installed

FOUNDATION = PRESETS["foundation"]
BOX = ["--box", "mug", "0.jpg", "10", "10", "50", "50"]


@pytest.fixture
def weights(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "weights"
    monkeypatch.setenv("GARDEN_WEIGHTS", str(folder))
    monkeypatch.delenv("GARDEN_MODELS", raising=False)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    return folder


def put(folder: Path, *names: str) -> None:
    """Put files by the right names in the place of models' weights."""
    for name in names:
        for file in card(name).weights:
            path = folder / name / file.path
            if file.path.endswith("/"):
                path = path / "any"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text("")


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    folder = tmp_path / "desk"
    folder.mkdir()
    rng = np.random.default_rng(0)
    for index in range(2):
        rgb = rng.integers(0, 255, (60, 80, 3), np.uint8)
        Image.fromarray(rgb).save(folder / f"{index}.jpg")
    return folder


def factorize(capture: Path, *arguments: str) -> int:
    store, out = capture.parent / "store", capture.parent / "scenes"
    return main(
        ["factorize", str(capture), "--preset", "foundation", "--store", str(store), "--out",
         str(out), *arguments]
    )  # fmt: skip


@pytest.mark.parametrize("missing", MODELS)
def test_a_missing_model_ends_the_command_before_any_work(
    missing: str, capture: Path, weights: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    put(weights, *(name for name in MODELS if name != missing))
    assert factorize(capture, *BOX) == 2
    said = capsys.readouterr().err.strip()
    first = card(missing).weights[0].path.rstrip("/")
    assert said.startswith(f"garden: {missing} needs its weights {first}")
    assert f"put them at {weights / missing / first}" in said
    assert "\n" not in said
    assert not (capture.parent / "scenes").exists()
    assert not (capture.parent / "store").exists()


def test_permissive_refuses_the_preset_by_name(
    capture: Path, weights: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert factorize(capture, *BOX, "--licence", "permissive") == 2
    said = capsys.readouterr().err.strip()
    assert "FoundationPose" in said
    assert "Depth-Anything-3" in said
    assert "SAM" not in said
    assert "\n" not in said


def test_models_of_targets_are_not_asked_for_where_there_are_none(weights: Path) -> None:
    put(weights, "depth_anything_3")
    check_weights(FOUNDATION, with_targets=False)
    with pytest.raises(BadInput, match="sam3"):
        check_weights(FOUNDATION, with_targets=True)


def test_the_embedded_preset_needs_none(weights: Path) -> None:
    check_weights(Preset(), with_targets=True)


def _plan(step: str, action: Literal["would run", "cached"]) -> list[PlanEntry]:
    why = Why("new", "it has not run before")
    return [PlanEntry(step, "", action, why, Ref("", "", "", "", step))]


def test_a_model_that_cannot_run_here_counts_only_if_its_step_would_run(weights: Path) -> None:
    put(weights, *MODELS)
    check_runnable(_plan("place_object", "cached"), FOUNDATION)
    with pytest.raises(BadInput, match=r"foundation_pose.*nvdiffrast"):
        check_runnable(_plan("place_object", "would run"), FOUNDATION)


def test_where_all_is_installed_all_may_run(tmp_path: Path) -> None:
    with installed(tmp_path, 392) as models:
        assert isinstance(models, Models)
        check_weights(FOUNDATION, with_targets=True)
        for step in ("predict_geometry", "segment", "mesh_object", "place_object"):
            check_runnable(_plan(step, "would run"), FOUNDATION)
