"""Read from a store what a scene took: nothing is executed."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

from flows.benchmark.latency.lookups import TimedPlan, timed_plan
from flows.benchmark.latency.timing import SceneTiming, StepTiming
from flows.benchmark.latency.totals import without_rendering
from flows.scene_run import SceneRequest, SceneResult
from storage import ActionRecord, Store
from tasks.step import PlanEntry, Seconds, step_name


def recorded_timings(request: SceneRequest, store: Store, repeat: int) -> list[SceneTiming]:
    """Return ``cold`` from the scene's action records, and ``cached`` by planning it.

    The scene is planned once before the clock runs, so that all scenes of a report are
    planned by a process in the same state. ``cached`` is measured ``repeat`` times, and
    only if the store has the whole scene and its package is up to date.
    """
    first = timed_plan(request, store)
    timings = [cold_timing(request, first, store)]
    if first.finished:
        timings += [
            cached_timing(request, timed_plan(request, store), number)
            for number in range(1, repeat + 1)
        ]
    return timings


def cold_timing(request: SceneRequest, planned: TimedPlan, store: Store) -> SceneTiming:
    """Return what the records of the planned actions say; steps without a record are missing."""
    steps: dict[str, StepTiming] = {}
    missing = []
    for entry in planned.plan:
        record = store.action(entry.ref.key) if entry.action == "cached" else None
        if record is None:
            missing.append(step_name(entry.step, entry.label))
        elif record.key not in steps:  # equal calls in one scene are executed once
            steps[record.key] = _recorded(request.name, entry.label, record)
    objects = tuple(target.name for target in planned.result.refs.targets)
    missing += [name for name in unfinished(planned.result) if name not in missing]
    timing = SceneTiming(request.name, "cold", 1, objects, tuple(steps.values()), tuple(missing))
    wall_s = without_rendering(_reported_wall(request.package, set(steps)), timing)
    return dataclasses.replace(timing, wall_s=wall_s)


def cached_timing(request: SceneRequest, planned: TimedPlan, number: int) -> SceneTiming:
    """Return the seconds of a plan's look-ups, for a scene with nothing to do."""
    return SceneTiming(
        request.name,
        "cached",
        number,
        tuple(target.name for target in planned.result.refs.targets),
        tuple(_looked_up(request.name, entry, planned, number) for entry in planned.plan),
        unfinished(planned.result),
        wall_s=planned.wall_s,
    )


def unfinished(result: SceneResult) -> tuple[str, ...]:
    """Name the steps that failed, and what of the scene there is not because of it."""
    failed = [failure.name for _target, failure in result.refs.failed_targets]
    if result.refs.failure is not None:
        failed.append(f"what follows {result.refs.failure.name}")
    return tuple(failed)


def _recorded(scene: str, target: str, record: ActionRecord) -> StepTiming:
    seconds = Seconds(**record.seconds)
    return StepTiming(
        scene=scene,
        target=target,
        step=record.step,
        mode="cold",
        repeat=1,
        seconds=seconds,
        started=record.started,
        ended=record.started + seconds.total - seconds.wait,
        peak_mb=record.peak_mb,
        backend=record.backend,
        host=record.host,
        run_id=record.run_id,
        key=record.key,
    )


def _looked_up(scene: str, entry: PlanEntry, planned: TimedPlan, number: int) -> StepTiming:
    return StepTiming(
        scene=scene,
        target=entry.label,
        step=entry.step,
        mode="cached",
        repeat=number,
        lookup_s=planned.lookup_s.get(entry.ref.key),
        backend=entry.ref.backend,
        key=entry.ref.key,
    )


def _reported_wall(package: Path, keys: set[str]) -> float | None:
    """Return the flow's clock if the package's report is of a run that executed just these."""
    try:
        report: Any = json.loads((package / "report.json").read_bytes())
        executed = {s["key"] for s in report["steps"] if s["outcome"] == "executed"}
        seconds = float(report["seconds"])
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return seconds if executed == keys else None
