"""`garden batch` and `garden status` from the command line, on captures that are soon done."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from flows.collection.definition import read_collection
from flows.collection.job import JobOrder
from flows.collection.row import SceneRow
from flows.collection.scene_job import SceneJob, scene_order
from flows.collection.state import CollectionState
from flows.command import main
from storage.owner import Owner


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two captures of noise, which no registration can place, and one that is broken."""
    rng = np.random.default_rng(0)
    for name in ("desk", "shelf", "attic"):
        (tmp_path / "captures" / name).mkdir(parents=True)
        for i in range(3):
            pixels = rng.integers(0, 256, (80, 120, 3)).astype(np.uint8)
            Image.fromarray(pixels).save(tmp_path / "captures" / name / f"{i}.jpg")
    broken = tmp_path / "captures" / "attic" / "1.jpg"
    broken.write_bytes(broken.read_bytes()[:100])
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("GARDEN_STORE", str(tmp_path / "store"))
    return tmp_path


Captured = pytest.CaptureFixture[str]


def answer(capsys: Captured, *arguments: str) -> tuple[int, dict[str, object]]:
    code = main([*arguments, "--json"])
    return code, json.loads(capsys.readouterr().out)


def test_plan_tells_of_every_scene_how_many_steps_would_run_and_why(
    home: Path, capsys: Captured
) -> None:
    assert main(["batch", "captures", "--plan"]) == 0
    told = capsys.readouterr().out
    assert "attic" in told
    assert "1.jpg" in told
    assert "2 of 3 scenes have something to do" in told
    code, document = answer(capsys, "batch", "captures", "--plan", "--only", "desk")
    assert code == 0
    (scene,) = document["scenes"]  # type: ignore[misc]
    assert scene["steps"][0] == {  # type: ignore[index]
        "step": "ingest",
        "target": None,
        "why": "it has not run before",
        "why_code": "new",
    }
    assert not (home / "scenes").exists(), "a preview writes nothing"


@pytest.mark.slow
def test_a_batch_of_captures_leaves_packages_a_page_and_its_state(
    home: Path, capsys: Captured
) -> None:
    code, document = answer(capsys, "batch", "captures", "--engine", "local")
    assert code == 1
    assert document["status"] == "failed"
    assert document["phase"] == "finished"
    rows = {row["name"]: row for row in document["scenes"]}  # type: ignore[attr-defined]
    assert "1.jpg" in rows["attic"]["reasons"][0]
    assert rows["desk"]["photos"] == [3, 0]
    assert rows["desk"]["executed"] == 2
    assert json.loads((home / "scenes" / "desk" / "report.json").read_text())["status"] == "failed"
    page = (home / "scenes" / "collection.html").read_text()
    assert page.index("attic") < page.index('href="desk/report.html"')
    assert page.count("<img") >= 2
    again, _document = answer(capsys, "batch", "captures", "--engine", "local", "--only", "failed")
    assert again == 1
    code, document = answer(capsys, "status", "captures")
    assert code == 0
    rows = {row["name"]: row for row in document["scenes"]}  # type: ignore[attr-defined]
    assert (rows["desk"]["executed"], rows["desk"]["cached"]) == (0, 2)


def test_an_order_gives_a_worker_the_same_scene(home: Path) -> None:
    box = '[{name = "mug", image = "0.jpg", box = [1, 2, 30, 40]}]'
    (home / "night.toml").write_text(
        f'[[scene]]\ncapture = "captures/desk"\ntargets = {box}\n'
        "settings = { simulation.seconds = 2 }\n"
    )
    request = replace(
        read_collection(Path("night.toml"), force=frozenset({"mesh_object"})).scenes[0],
        remarks=("a remark",),
    )
    line = json.dumps(dataclasses.asdict(scene_order(request)))
    made = JobOrder(**json.loads(line)).make()
    assert isinstance(made, SceneJob)
    assert made.request == request


def test_status_tells_a_killed_batch_from_one_that_runs(home: Path, capsys: Captured) -> None:
    row = SceneRow("desk", "running", started=1.0)
    out = home / "scenes"
    out.mkdir()
    me = Owner.here()
    state = CollectionState("captures", "captures", "store", out, {"desk": row}, owner=me)
    state.save()
    _code, document = answer(capsys, "status", "scenes")
    assert (document["phase"], document["alive"]) == ("running", True)
    state.owner = replace(me, started=me.started + 1)  # the number of a process that is gone
    state.save()
    _code, document = answer(capsys, "status", "captures")
    assert (document["phase"], document["alive"]) == ("stopped (killed)", False)
    assert document["counts"] == {"stopped": 1}
    assert main(["status"]) == 0
    assert "stopped (killed)" in capsys.readouterr().out


def test_status_without_a_batch_is_wrong_use(home: Path, capsys: Captured) -> None:
    code, document = answer(capsys, "status", "captures")
    assert code == 2
    assert "collection.json" in str(document["reasons"])


def test_a_budget_larger_than_the_machine_is_wrong_use(home: Path, capsys: Captured) -> None:
    code, document = answer(capsys, "batch", "captures", "--cores", "100000")
    assert code == 2
    assert "100000 cores" in str(document["reasons"])
