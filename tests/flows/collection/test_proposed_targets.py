"""Proposed targets in a collection: for the scenes that have no boxes of their own."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from flows.collection.definition import read_collection
from flows.collection.scene_job import SceneJob, scene_order
from flows.command import main
from flows.proposal_options import ProposalOptions
from flows.scene_run import SceneRequest
from storage import Store
from tests.flows.collection.test_definition import make_capture, write

BOXES = {"targets": [{"name": "mug", "image": "0.png", "box": [1, 2, 30, 40]}]}
FILE = """
[settings]
propose.model = "qwen3-vl-8b"
propose.address = "http://localhost:8000/v1"
[[scene]]
capture = "captures/desk"
targets = [{ name = "mug", image = "0.png", box = [1, 2, 30, 40] }]
[[scene]]
capture = "captures/hall"
settings = { propose.goal = "all of it falls", propose.temperature = 0.5 }
[[scene]]
capture = "captures/shelf"
"""


@pytest.fixture
def home(tmp_path: Path) -> Path:
    for name in ("desk", "hall", "shelf"):
        make_capture(tmp_path / "captures" / name)
    (tmp_path / "captures" / "shelf" / "targets.json").write_text(json.dumps(BOXES))
    return tmp_path


def models(scenes: tuple[SceneRequest, ...]) -> dict[str, str]:
    return {scene.name: scene.preset.propose.model for scene in scenes}


def test_settings_propose_where_there_are_no_boxes_at_all(home: Path) -> None:
    scenes = read_collection(write(home, FILE)).scenes
    assert models(scenes) == {"desk": "", "hall": "qwen3-vl-8b", "shelf": ""}
    hall = next(scene for scene in scenes if scene.name == "hall")
    assert hall.preset.propose.goal == "all of it falls"
    assert hall.preset.propose.address == "http://localhost:8000/v1"


def test_the_option_also_proposes_where_a_targets_json_lies(home: Path) -> None:
    asked = ProposalOptions(model="gemini-4", goal="clear the room")
    scenes = read_collection(write(home, FILE), proposal=asked).scenes
    assert models(scenes) == {"desk": "", "hall": "gemini-4", "shelf": "gemini-4"}
    assert {s.preset.propose.goal for s in scenes if s.preset.propose.model} == {"clear the room"}
    folder = read_collection(home / "captures", proposal=ProposalOptions(labels=("mug",)))
    assert {s.preset.ground.labels for s in folder.scenes} == {("mug",)}


def test_a_model_that_cannot_be_asked_is_that_scenes_failure(home: Path) -> None:
    text = FILE.replace('propose.goal = "all of it falls"', 'propose.model = "gpt-9"')
    found = read_collection(write(home, text)).unreadable
    assert [scene.name for scene in found] == ["hall"]
    assert "how gpt-9 writes boxes is not known" in found[0].reason


def test_a_worker_gets_the_same_options(home: Path) -> None:
    for wanted in read_collection(write(home, FILE)).scenes:
        order: Any = scene_order(wanted)
        arguments = json.loads(json.dumps(order.arguments))
        made = type(order)(order.name, order.job, arguments).make()
        assert isinstance(made, SceneJob)
        assert made.request == wanted


def test_a_missing_key_is_told_before_any_work(
    home: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("GEMINI_API_KEY", "GOOGLE_API_KEY"):
        monkeypatch.delenv(name, raising=False)
    captures, store = str(home / "captures"), str(home / "store")
    arguments = ["batch", captures, "--out", str(home / "out"), "--store", store, "--json"]
    arguments += ["--engine", "local", "--propose", "gemini-4"]
    assert main(arguments) == 1
    scenes = {scene["name"]: scene for scene in json.loads(capsys.readouterr().out)["scenes"]}
    assert {scene["status"] for scene in scenes.values()} == {"failed"}
    assert "GEMINI_API_KEY" in scenes["hall"]["reasons"][0]
    assert list(Store.open(store).actions()) == []


def test_models_of_other_machines_are_not_looked_for_here(home: Path) -> None:
    wanted = read_collection(write(home, FILE)).scenes[0]
    here, there = (scene_order(wanted, models_here=here) for here in (True, False))
    assert (here.make().models_here, there.make().models_here) == (True, False)  # type: ignore[attr-defined]


def test_a_batch_plans_it(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["batch", str(write(home, FILE)), "--plan", "--json"]
    arguments += ["--propose", "gemini-4", "--store", str(home / "store")]
    assert main(arguments) == 0
    plans = {p["name"]: p for p in json.loads(capsys.readouterr().out)["scenes"]}
    steps = {name: {step["step"] for step in plan["steps"]} for name, plan in plans.items()}
    assert "check_targets" in steps["hall"] & steps["shelf"]
    assert "check_targets" not in steps["desk"]
