"""The fresh process of one measurement: execute a scene cold and warm, or find it finished."""

from __future__ import annotations

import dataclasses
import json
import socket
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

from flows.benchmark.latency.lookups import timed_plan
from flows.benchmark.latency.recorded import cached_timing, unfinished
from flows.benchmark.latency.timing import Mode, SceneTiming, StepTiming
from flows.benchmark.latency.totals import without_rendering
from flows.benchmark.latency.wire import Json, timing_to_json
from flows.collection.scene_job import scene_job
from flows.package.write import refresh_report, write_scene_package
from flows.scene_run import SceneRequest, SceneResult, run_scene
from storage import Store
from tasks.step import StepEvent


def main(room: Path) -> int:
    """Do what ``order.json`` in ``room`` says; leave ``answer.json`` there."""
    order: Json = json.loads((room / "order.json").read_text())
    request = scene_job(**order["request"]).request
    request = dataclasses.replace(request, package=Path(order["packages"]) / request.name)
    store = Store.open(order["store"])
    do = _execute if order["task"] == "execute" else _rerun
    timings = do(request, store, order)
    (room / "answer.json").write_text(json.dumps([timing_to_json(t) for t in timings]))
    return 0


def _execute(request: SceneRequest, store: Store, order: Json) -> list[SceneTiming]:
    timed_plan(request, store)  # as `garden factorize` does before it runs anything
    clock = StepClock()
    result = run_scene(request, store, clock, order["engine"])
    write_scene_package(result, store)
    process_s = time.monotonic() - order["started"]
    cold = executed_timing(result, clock, "cold", order["repeat"])
    cold = dataclasses.replace(cold, process_s=without_rendering(process_s, cold))
    if not cold.complete:
        return [cold]
    again = dataclasses.replace(request, force=frozenset({"*"}))
    clock = StepClock()
    result = run_scene(again, store, clock, order["engine"])
    return [cold, executed_timing(result, clock, "warm", order["repeat"])]


def _rerun(request: SceneRequest, store: Store, order: Json) -> list[SceneTiming]:
    planned = timed_plan(request, store)
    if not planned.finished:
        raise RuntimeError(f"{request.name} is not finished right after it was run")
    refresh_report(planned.result)
    process_s = time.monotonic() - order["started"]
    timing = cached_timing(request, planned, order["repeat"])
    return [dataclasses.replace(timing, process_s=process_s)]


@dataclass
class StepClock:
    """Note when each step started; the last start counts."""

    started: dict[tuple[str, str], float] = field(default_factory=dict)

    def __call__(self, event: StepEvent) -> None:
        """Take one event."""
        if event.kind == "started":
            self.started[event.step, event.label] = event.time


def executed_timing(result: SceneResult, clock: StepClock, mode: Mode, number: int) -> SceneTiming:
    """Return a run's timing; what failed is missing."""
    executed = [e for e in result.outcomes if e.outcome == "executed"]
    timing = SceneTiming(
        result.request.name,
        mode,
        number,
        tuple(target.name for target in result.refs.targets),
        tuple(_step(e, clock.started.get((e.step, e.label)), mode, number) for e in executed),
        unfinished(result),
    )
    return dataclasses.replace(timing, wall_s=without_rendering(result.seconds, timing))


def _step(event: StepEvent, started: float | None, mode: Mode, number: int) -> StepTiming:
    worked = event.seconds.total - event.seconds.wait
    return StepTiming(
        scene=event.scene,
        target=event.label,
        step=event.step,
        mode=mode,
        repeat=number,
        seconds=event.seconds,
        started=event.time - worked if started is None else started,
        ended=event.time,
        peak_mb=event.peak_mb,
        backend=event.backend,
        host=socket.gethostname(),
        key=event.ref.key if event.ref else "",
    )


if __name__ == "__main__":
    raise SystemExit(main(Path(sys.argv[1])))
