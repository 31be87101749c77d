"""The order of a scene names its models, and where it lets other scenes catch up."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import pytest

from flows.collection import scene_job
from flows.collection.job import JobOrder, JobRun
from flows.collection.scene_job import scene_order
from flows.factorize import SceneRefs
from flows.preset import Preset
from flows.scene_run import SceneRequest, SceneResult
from garden_models.reconstruction.photo_geometry_config import PhotoGeometry
from garden_models.targets.config import GroundTargets
from storage import Store
from tasks.ingest import CaptureSource
from tasks.step import Budget, Postponed

PRESET = Preset(
    geometry=PhotoGeometry(method="depth_anything_3"), ground=GroundTargets(model="grounding_dino")
)


def request(tmp_path: Path, preset: Preset) -> SceneRequest:
    return SceneRequest("room", CaptureSource("photos", ()), (), preset, tmp_path / "room")


def test_models_and_stops_come_from_the_preset(tmp_path: Path) -> None:
    order = scene_order(request(tmp_path, PRESET))
    assert order.models == ("depth_anything_3", "grounding_dino")
    assert order.stops == ("ground_targets",)
    plain = scene_order(request(tmp_path, Preset()))
    assert (plain.models, plain.stops) == ((), ())


def test_what_is_forced_runs_in_one_pass(tmp_path: Path) -> None:
    forced = dataclasses.replace(request(tmp_path, PRESET), force=frozenset({"segment"}))
    assert scene_order(forced).stops == ()


def test_a_job_reports_the_step_that_it_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[Any] = []

    def run_scene(asked: SceneRequest, *rest: Any) -> SceneResult:
        given.extend(rest)
        refs = SceneRefs(())
        refs.failure = Postponed("ground_targets", "")
        return SceneResult(asked, refs)

    monkeypatch.setattr(scene_job, "run_scene", run_scene)
    order = scene_order(request(tmp_path, PRESET))
    sent = JobOrder(**dataclasses.asdict(dataclasses.replace(order, postponed=order.stops)))
    budget = Budget((0,), 1.0, (), tmp_path)
    run = JobRun(lambda _event: None, "local", budget, postponed=frozenset(sent.postponed))
    assert sent.make().run(Store.open(tmp_path / "store"), run) == {"postponed": "ground_targets"}
    assert given[-1] == frozenset({"ground_targets"})
    assert not (tmp_path / "room").exists()
