"""The benchmark of models measures both ways, and what cannot run leaves the rest alone."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from flows.benchmark.models.measure_all import measure_all
from flows.benchmark.models.questions import questions, stages
from flows.benchmark.models.report import ModelsReport
from flows.command import main
from flows.wrong_use import WrongUse
from garden_models import foundation
from garden_models.scene import BadInput
from tests.flows.benchmark.models.flat_wall import LOAD_S, PHOTO_S
from tests.tasks.model.doubler import put_weights


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setitem(foundation.ADAPTERS, "flat_wall", "tests.flows.benchmark.models.flat_wall")
    monkeypatch.setenv("GARDEN_WEIGHTS", str(tmp_path / "weights"))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("GARDEN_MODELS", raising=False)
    put_weights(tmp_path / "weights/flat_wall")
    return tmp_path


def measured(home: Path, *names: str, photos: tuple[int, ...] = (1, 3)) -> ModelsReport:
    (home / "work").mkdir()
    return measure_all(
        names=names,
        photos=photos,
        size=(32, 24),
        repeats=3,
        random=False,
        variant=None,
        folder=home / "work",
        say=lambda _text: None,
    )


@pytest.mark.slow
def test_seconds_and_memory_are_the_models(home: Path) -> None:
    report = measured(home, "flat_wall")
    assert report.failed == {}
    assert [m.photos for m in report.measured] == [1, 3]
    for m in report.measured:
        least = PHOTO_S * m.photos
        assert m.bare.load_s >= LOAD_S
        assert m.step.load_s >= LOAD_S
        assert least <= m.bare.run_s
        assert least <= m.model_s <= m.step.run_s
        assert m.bare.peak_gb > 0.2
        assert m.step.peak_gb > 0.2
        assert m.bare.peak_gpu_gb == 0.0
    assert list((home / "work").iterdir()) == []


@pytest.mark.slow
def test_a_model_that_is_not_here_is_told_and_the_others_are_measured(
    home: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (home / "weights/flat_wall/factor.txt").unlink()
    command = ["benchmark", "models", "flat_wall", "--photos", "1", "--repeats", "1"]
    code = main([*command, "--store", str(home / "store"), "--json", "--out", str(home / "out")])
    document = json.loads(capsys.readouterr().out)
    assert code == 1
    assert "put them at" in document["failed"]["flat_wall, 1 photos"]
    put_weights(home / "weights/flat_wall")
    assert main([*command, "--store", str(home / "store"), "--out", str(home / "out")]) == 0
    assert "| flat_wall" in (home / "out/models.md").read_text()
    row = json.loads((home / "out/models.json").read_text())["measured"][0]
    assert row["model"] == "flat_wall"


@pytest.mark.slow
def test_depth_anything_3_is_measured_with_random_weights(home: Path) -> None:
    report = measure_all(
        names=("depth_anything_3",),
        photos=(2,),
        size=(84, 56),
        repeats=1,
        random=True,
        variant=None,
        folder=home / "random",
        say=print,
    )
    assert report.failed == {}
    (found,) = report.measured
    assert found.model == "depth_anything_3/da3-small"
    assert min(found.bare.load_s, found.step.load_s, found.bare.run_s, found.model_s) > 0
    assert found.step.run_s >= found.model_s
    assert "random weights" in report.to_text()


@pytest.mark.parametrize("words", [["--size", "640"], ["--photos", "0"], ["--repeats", "0"]])
def test_wrong_options_are_told(home: Path, words: list[str]) -> None:
    assert main(["benchmark", "models", *words, "--store", str(home / "store")]) == 2


def test_unknown_models_and_weights_that_cannot_be_made_are_told(home: Path) -> None:
    with pytest.raises(BadInput, match="no model is called 'nobody'"):
        measured(home, "nobody")
    with pytest.raises(WrongUse, match=r"random weights can be made of .* not of flat_wall"):
        measure_all(
            names=("flat_wall",), photos=(1,), size=(8, 8), repeats=1, random=True, variant=None,
            folder=home / "random", say=print,
        )  # fmt: skip


@pytest.mark.parametrize("stage", stages())
def test_questions_are_about_so_many_photos(stage: str) -> None:
    asked = questions(stage, 3, (40, 30))
    photos = asked[0].photos if stage == "reconstruct" else [q.rgb for q in asked]
    assert [p.shape for p in photos] == [(30, 40, 3)] * 3
    assert not np.array_equal(photos[0], photos[1])
    assert questions("targets", 3, (40, 30)) == []
