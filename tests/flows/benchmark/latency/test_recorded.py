"""Without --run nothing is executed: what the store knows is told, and what it does not."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from flows.benchmark.latency.document import Measured, latency_document
from flows.benchmark.latency.machine import Machine
from flows.benchmark.latency.recorded import recorded_timings
from flows.benchmark.latency.report import write_latency_report
from flows.benchmark.latency.totals import scene_seconds, totals
from flows.command import main
from flows.scene_run import SceneRequest, plan_scene
from storage import Store, StoreMissing
from tests.flows.benchmark.latency.filled_store import Clock, Cost, fill, pack, request

OBJECT_STEPS = ("find_rivals", "segment", "mesh_object", "place_object", "label_points")


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store.open(tmp_path / "store", durability="none")


@pytest.fixture
def scene(tmp_path: Path) -> SceneRequest:
    return request(tmp_path)


def test_every_step_has_the_seconds_memory_and_place_of_its_record(
    store: Store, scene: SceneRequest
) -> None:
    clock = Clock()
    fill(store, scene, clock)
    cold = recorded_timings(scene, store, 1)[0]
    assert cold.complete and cold.objects == ("mug", "jar")
    assert {step.name for step in cold.steps} == clock.costs.keys()
    assert len(clock.costs) == 8 + 2 * len(OBJECT_STEPS)
    for step in cold.steps:
        cost = clock.costs[step.name]
        assert step.seconds is not None
        assert (step.seconds.load, step.seconds.compute) == (cost.load, cost.compute)
        assert (step.seconds.publish, step.seconds.wait) == (cost.publish, cost.wait)
        assert (step.peak_mb, step.host, step.run_id) == (cost.peak_mb, cost.host, cost.run_id)
        assert step.span == (cost.started - cost.wait, cost.started + 2.75)


def test_rendering_is_left_out_of_totals_and_shown_by_itself(
    store: Store, scene: SceneRequest
) -> None:
    clock = Clock({"render": Cost(9_000_000.0, compute=500.0, peak_mb=9999.0)})
    fill(store, scene, clock)
    cold = recorded_timings(scene, store, 1)[0]
    whole = totals(cold.steps)
    assert whole.work == pytest.approx(2.875 * (len(cold.steps) - 1))
    assert scene_seconds(cold) == pytest.approx(2.875 * (len(cold.steps) - 1))
    assert whole.render == pytest.approx(500.875)
    assert whole.peak_mb == 100.0
    assert whole.parts["compute"] == pytest.approx(2.0 * (len(cold.steps) - 1))


def test_nothing_is_executed_or_changed(store: Store, scene: SceneRequest) -> None:
    fill(store, scene, Clock(), leave_out=("simulate",))
    before = [record.key for record in store.actions()]
    recorded_timings(scene, store, 3)
    assert [record.key for record in store.actions()] == before


def test_a_scene_with_an_unknown_step_has_no_total_and_says_which(
    tmp_path: Path, store: Store, scene: SceneRequest
) -> None:
    fill(store, scene, Clock(), leave_out=("label_points",))
    whole = request(tmp_path, "hall")
    fill(store, whole, Clock({"ingest": Cost(5.0, compute=7.0)}))
    paths = [tmp_path / "captures" / name for name in ("desk", "hall")]
    for path, wanted in zip(paths, (scene, whole), strict=True):
        boxes = [{"name": t.name, "image": t.photo, "box": t.box} for t in wanted.targets]
        (path / "targets.json").write_text(json.dumps({"targets": boxes}))
    document = write_latency_report(paths, tmp_path / "out", store.address)
    desk, hall = document["scenes"]
    assert desk["modes"]["cold"]["p50_s"] is None and desk["modes"]["cold"]["work_s"] is None
    assert {"label_points[mug]", "label_points[jar]", "compose"} <= set(desk["missing"])
    assert hall["missing"] == [] and hall["modes"]["cold"]["p50_s"] > 0
    assert document["over_scenes"]["cold"]["count"] == 1
    assert document["over_scenes"]["cold"]["p50_s"] == hall["modes"]["cold"]["p50_s"]
    assert document["status"] == "degraded"
    absent = "\n".join(document["absent"])
    assert "desk: no cold total, nothing is known of label_points[mug]" in absent
    assert "warm seconds" in absent and "desk: no cached seconds" in absent


def test_cached_is_measured_only_if_a_rerun_has_nothing_to_do(
    store: Store, scene: SceneRequest
) -> None:
    fill(store, scene, Clock())
    assert [t.mode for t in recorded_timings(scene, store, 2)] == ["cold"]
    pack(store, scene)
    timings = recorded_timings(scene, store, 2)
    assert [(t.mode, t.repeat) for t in timings] == [("cold", 1), ("cached", 1), ("cached", 2)]
    for cached in timings[1:]:
        lookups = [step.lookup_s for step in cached.steps]
        assert len(lookups) == len(timings[0].steps)
        assert cached.wall_s is not None
        assert 0 < sum(s for s in lookups if s is not None) < cached.wall_s
        assert scene_seconds(cached) == cached.wall_s


def test_a_scene_that_failed_early_is_not_counted_as_a_fast_one(
    store: Store, scene: SceneRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    original = Store.record

    def failing(self: Store, record):  # type: ignore[no-untyped-def]
        if record.step == "register":
            record.verdict.update(status="failed", reasons=["no two photos match"])
        return original(self, record)

    monkeypatch.setattr(Store, "record", failing)
    fill(store, scene, Clock())
    pack(store, scene)
    for timing in recorded_timings(scene, store, 1):
        assert not timing.complete
        assert timing.missing == ("what follows register",)
        assert scene_seconds(timing) is None


def test_the_clock_of_the_flow_counts_only_if_that_run_executed_every_step(
    store: Store, scene: SceneRequest
) -> None:
    fill(store, scene, Clock())
    keys = [entry.ref.key for entry in plan_scene(scene, store)[1]]

    def wall(outcome_of_first: str) -> float | None:
        steps = [{"key": key, "outcome": "executed"} for key in keys]
        steps[0]["outcome"] = outcome_of_first
        pack(store, scene, json.dumps({"seconds": 200.0, "steps": steps}).encode())
        return recorded_timings(scene, store, 1)[0].wall_s

    assert wall("executed") == pytest.approx(200.0 - 2.875)  # less the rendering
    assert wall("cached") is None


def test_seconds_of_several_runs_are_said_to_be_so(
    tmp_path: Path, store: Store, scene: SceneRequest
) -> None:
    fill(store, scene, Clock({"ingest": Cost(1.0, run_id="another")}))
    measured = Measured(tuple(recorded_timings(scene, store, 1)), "", Machine("h", "c", 2, 8.0))
    assert latency_document(measured)["scenes"][0]["runs"] == 2
    boxes = [{"name": t.name, "image": t.photo, "box": t.box} for t in scene.targets]
    targets = tmp_path / "captures" / "desk" / "targets.json"
    targets.write_text(json.dumps({"targets": boxes}))
    document = write_latency_report([targets.parent], tmp_path / "out", store.address)
    assert any("put together from 2 runs" in line for line in document["absent"])


def test_the_command_prints_the_same_numbers_and_writes_three_files(
    tmp_path: Path, store: Store, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = request(tmp_path, targets=())
    fill(store, scene, Clock())
    arguments = ["benchmark", "latency", str(tmp_path / "captures"), "--out", str(tmp_path / "out")]
    assert main([*arguments, "--store", store.address, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["schema"] == "garden.latency/1"
    assert document["scenes"][0]["modes"]["cold"]["p50_s"] == pytest.approx(2.875 * 7)
    assert document["scenes"][0]["modes"]["cold"]["per_object_s"] is None
    written = {path.name for path in (tmp_path / "out").iterdir()}
    assert written == {"latency.parquet", "latency.md", "latency.html"}
    assert main([*arguments, "--store", store.address]) == 0
    text = capsys.readouterr().out
    request(tmp_path, "hall")
    assert main([*arguments, "--store", store.address]) == 3  # nothing is known of the hall
    nothing = [*arguments[:2], str(tmp_path / "captures" / "hall"), *arguments[3:]]
    assert main([*nothing, "--store", store.address]) == 1
    assert "Darwin-BedRoom" in text and "RTX A6000" in text and "desk" in text


def test_wrong_use_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    request(tmp_path)
    captures = tmp_path / "captures"
    with pytest.raises(StoreMissing):
        write_latency_report([captures], tmp_path / "out", tmp_path / "nowhere")
    out = ["--out", str(tmp_path / "out"), "--store", str(tmp_path / "nowhere")]
    assert main(["benchmark", "latency", *out]) == 2
    assert "no scene to report on" in capsys.readouterr().err
    assert main(["benchmark", "latency", str(captures), "--repeat", "0", *out]) == 2
    assert main(["benchmark", "latency", str(captures), str(captures / "desk"), *out]) == 2
    assert "two scenes are called desk" in capsys.readouterr().err
