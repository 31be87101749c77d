"""--run: real processes, an empty store, and timings that come back whole."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from flows.benchmark.latency import measured
from flows.benchmark.latency.measured import Measurement, MeasurementFailed, measured_timings
from flows.benchmark.latency.report import LatencyOptions, write_latency_report
from flows.benchmark.latency.scene_process import StepClock, executed_timing
from flows.benchmark.latency.timing import SceneTiming, StepTiming
from flows.benchmark.latency.wire import timing_from_json, timing_to_json
from flows.factorize import SceneRefs
from flows.scene_run import SceneRequest, SceneResult
from storage import Store
from tasks.step import Seconds, StepEvent, StepFailed
from tests.flows.benchmark.latency.filled_store import TARGETS, Clock, fill, pack, request


@pytest.fixture
def scene(tmp_path: Path) -> SceneRequest:
    return request(tmp_path)


def test_a_timing_comes_back_as_it_was() -> None:
    steps = (
        StepTiming("desk", "mug", "segment", "warm", 2, Seconds(1, 2, 3, 4), None, 5.0, 6.0, 7.0),
        StepTiming("desk", "", "ingest", "cached", 1, lookup_s=0.25),
    )
    timing = SceneTiming("desk", "warm", 2, ("mug",), steps, ("compose",), 3.0, None)
    assert timing_from_json(json.loads(json.dumps(timing_to_json(timing)))) == timing


def test_a_run_tells_when_each_step_started_ended_and_what_it_took(scene: SceneRequest) -> None:
    clock = StepClock()
    clock(StepEvent("started", "register", "", "desk", 100.0))
    cost = Seconds(load=1.0, compute=5.0, publish=1.0, wait=2.0)
    done = StepEvent(
        "finished", "register", "", "desk", 110.0, outcome="executed", seconds=cost, peak_mb=9.0
    )
    drawn = StepEvent(
        "finished", "render", "", "desk", 114.0, outcome="executed", seconds=Seconds(compute=4.0)
    )
    cached = StepEvent("finished", "ingest", "", "desk", 90.0, outcome="cached")
    result = SceneResult(scene, SceneRefs(()), [cached, done, drawn], seconds=20.0)
    timing = executed_timing(result, clock, "warm", 2)
    register = timing.steps[0]
    assert [step.step for step in timing.steps] == ["register", "render"]
    assert register.span == (98.0, 110.0) and register.seconds == cost  # 3 s started a process
    assert timing.steps[1].span == (110.0, 114.0)
    assert (timing.mode, timing.repeat, timing.wall_s) == ("warm", 2, 16.0)


def test_a_failed_target_leaves_a_scene_without_total(scene: SceneRequest) -> None:
    failed = ((TARGETS[0], StepFailed("segment", "mug", "its box holds no points")),)
    done = StepEvent("finished", "ingest", "", "desk", 1.0, outcome="executed")
    result = SceneResult(scene, SceneRefs((), failed_targets=failed), [done])
    assert executed_timing(result, StepClock(), "cold", 1).missing == ("segment[mug]",)


@pytest.mark.slow
def test_a_finished_scene_is_found_by_a_fresh_process(tmp_path: Path, scene: SceneRequest) -> None:
    room = tmp_path / "room"
    store = Store.open(room / "store")
    fill(store, scene, Clock())
    pack(store, replace(scene, package=room / "packages" / scene.name))
    how = Measurement(tmp_path)
    (cached,) = measured.in_fresh_process("rerun", scene, 3, how, room)
    assert (cached.mode, cached.repeat, cached.complete) == ("cached", 3, True)
    assert len(cached.steps) == 18 and all(step.lookup_s for step in cached.steps)
    assert cached.wall_s is not None and cached.process_s is not None
    assert cached.process_s > cached.wall_s > 0


@pytest.mark.slow
def test_a_scene_that_fails_is_run_from_an_empty_store_and_leaves_nothing(
    tmp_path: Path, scene: SceneRequest
) -> None:
    """Noise has no cameras: the real pipeline ends after its second step."""
    how = Measurement(tmp_path / "out", engine="local")
    (cold,) = measured_timings(scene, how)
    assert cold.mode == "cold" and not cold.complete
    assert cold.missing == ("what follows register",)
    assert cold.steps[0].step == "ingest" and cold.steps[0].total_s > 0
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.slow
def test_a_process_that_dies_is_told_with_what_it_said_last(
    tmp_path: Path, scene: SceneRequest
) -> None:
    room = tmp_path / "room"
    room.mkdir()
    with pytest.raises(MeasurementFailed, match=r"(?s)desk: .* not finished right after"):
        measured.in_fresh_process("rerun", scene, 1, Measurement(tmp_path), room)


def test_a_scene_whose_process_died_stops_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    request(tmp_path, "desk", ())
    request(tmp_path, "hall", ())
    done = StepTiming("hall", "", "ingest", "cold", 1, Seconds(compute=3.0), None, 5.0, 8.0)

    def measure(wanted: SceneRequest, how: Measurement) -> list[SceneTiming]:
        if wanted.name == "desk":
            raise MeasurementFailed("desk: its process ended with code -9; it said last: ")
        return [SceneTiming("hall", "cold", 1, (), (done,))]

    monkeypatch.setattr("flows.benchmark.latency.report.measured_timings", measure)
    options = LatencyOptions(execute=True)
    document = write_latency_report([tmp_path / "captures"], tmp_path / "out", "", options)
    assert [scene["scene"] for scene in document["scenes"]] == ["hall"]
    assert document["over_scenes"]["cold"]["p50_s"] == 3.0
    assert any("desk: its process ended with code -9" in line for line in document["absent"])
