"""Put a latency report together as one JSON value (schema ``garden.latency/1``)."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from flows.benchmark.latency import paper
from flows.benchmark.latency.machine import Machine
from flows.benchmark.latency.percentiles import Percentiles, median, percentiles
from flows.benchmark.latency.timing import DEFINITIONS, MODES, Mode, SceneTiming, StepTiming
from flows.benchmark.latency.totals import Totals, scene_seconds, totals

SCHEMA = "garden.latency/1"
Json = dict[str, Any]


@dataclass(frozen=True)
class Measured:
    """What a report is made from: the timings, how they came about, and what is absent.

    ``lost`` is the number of scenes of which there is no timing at all.
    """

    timings: tuple[SceneTiming, ...]
    source: str
    machine: Machine
    absent: tuple[str, ...] = ()
    lost: int = 0

    def of(self, mode: Mode, scene: str | None = None) -> list[SceneTiming]:
        """Return the timings of one mode, of all scenes or of one."""
        return [t for t in self.timings if t.mode == mode and scene in (None, t.scene)]

    @property
    def scenes(self) -> list[str]:
        """The scenes' names, in the order given."""
        return list(dict.fromkeys(t.scene for t in self.timings))


def latency_document(measured: Measured) -> Json:
    """Return the whole report; all times in seconds, rendering left out of every total."""
    scenes = [_scene(measured, name) for name in measured.scenes]
    return {
        "schema": SCHEMA,
        "status": _status(scenes, measured.lost),
        "made": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "source": measured.source,
        "machine": dataclasses.asdict(measured.machine),
        "definitions": dict(DEFINITIONS),
        "absent": list(measured.absent),
        "over_scenes": {
            mode: _percentiles(percentiles(s["modes"][mode]["p50_s"] for s in scenes))
            for mode in MODES
        },
        "scenes": scenes,
        "steps": _steps_over_scenes(measured),
        "paper": _paper(),
    }


def _status(scenes: list[Json], lost: int) -> str:
    """Return ok if all scenes have a cold total, degraded if some have, failed if none has."""
    known = [scene for scene in scenes if scene["modes"]["cold"]["count"]]
    if not known:
        return "failed"
    return "ok" if len(known) == len(scenes) + lost else "degraded"


def _scene(measured: Measured, name: str) -> Json:
    cold = measured.of("cold", name)
    steps = [step for timing in cold for step in timing.steps]
    objects = next((t.objects for t in measured.timings if t.scene == name), ())
    return {
        "scene": name,
        "objects": len(objects),
        "missing": sorted({step for t in cold for step in t.missing}),
        "hosts": sorted({step.host for step in steps if step.host}),
        "runs": len({step.run_id for step in steps if step.run_id}),
        "modes": {m: _mode_of_scene(measured.of(m, name), len(objects)) for m in MODES},
        "by_object": [_object(measured, name, target) for target in objects],
        "by_step": _steps_of_scene(measured, name),
    }


def _mode_of_scene(timings: list[SceneTiming], objects: int) -> Json:
    seconds = percentiles(scene_seconds(t) for t in timings)
    complete = [totals(t.steps) for t in timings if t.complete]
    p50 = seconds.p50 if seconds else None
    return {
        **_percentiles(seconds),
        "per_object_s": p50 / objects if p50 is not None and objects else None,
        "work_s": median(t.work for t in complete),
        "wall_s": median(t.wall_s for t in timings if t.complete),
        "process_s": median(t.process_s for t in timings if t.complete),
        "render_s": median(t.render for t in complete),
        "peak_mb": max((t.peak_mb for t in complete if t.peak_mb is not None), default=None),
        "shares": _shares(complete),
    }


def _object(measured: Measured, scene: str, target: str) -> Json:
    """Return what the steps of one target took (not the share of the scene's own steps)."""
    modes: Json = {}
    for mode in MODES:
        of_target = [
            totals([s for s in timing.steps if s.target == target])
            for timing in measured.of(mode, scene)
            if timing.complete
        ]
        modes[mode] = {
            **_percentiles(percentiles(t.work for t in of_target)),
            "peak_mb": max((t.peak_mb for t in of_target if t.peak_mb is not None), default=None),
            "shares": _shares(of_target),
        }
    return {"object": target, "modes": modes}


def _steps_of_scene(measured: Measured, scene: str) -> list[Json]:
    of_scene = [step for t in measured.timings if t.scene == scene for step in t.steps]
    names = dict.fromkeys((step.step, step.target) for step in of_scene)
    return [
        {
            "step": step,
            "object": target or None,
            **_step_modes([s for s in of_scene if (s.step, s.target) == (step, target)]),
        }
        for step, target in names
    ]


def _steps_over_scenes(measured: Measured) -> list[Json]:
    """Return each step over all scenes and objects; each counts once, with its median."""
    everything = [step for timing in measured.timings for step in timing.steps]
    return [
        {"step": name, **_step_modes([s for s in everything if s.step == name])}
        for name in dict.fromkeys(step.step for step in everything)
    ]


def _step_modes(steps: list[StepTiming]) -> Json:
    return {
        "evaluation_only": steps[0].evaluation_only,
        "calls": len({(step.scene, step.target) for step in steps}),
        "modes": {mode: _mode_of_step([s for s in steps if s.mode == mode]) for mode in MODES},
    }


def _mode_of_step(steps: list[StepTiming]) -> Json:
    of_call: dict[tuple[str, str], list[float]] = {}
    for step in steps:
        of_call.setdefault((step.scene, step.target), []).append(step.total_s)
    if len(of_call) > 1:
        found = percentiles(median(own) for own in of_call.values())
    else:
        found = percentiles(own for several in of_call.values() for own in several)
    return {
        **_percentiles(found),
        "peak_mb": max((s.peak_mb for s in steps if s.peak_mb is not None), default=None),
        "shares": _shares([_alone(step) for step in steps]),
    }


def _alone(step: StepTiming) -> Totals:
    """Return a step's parts even if totals leave it out."""
    parts = dataclasses.asdict(step.seconds) if step.seconds else {}
    return Totals(step.total_s, None, parts, 0.0, step.peak_mb)


def _shares(several: Iterable[Totals]) -> dict[str, float]:
    sums: dict[str, float] = {}
    for one in several:
        for name, value in one.parts.items():
            sums[name] = sums.get(name, 0.0) + value
    return Totals(0.0, None, sums, 0.0, None).shares


def _percentiles(found: Percentiles | None) -> Json:
    if found is None:
        return {"p50_s": None, "p95_s": None, "count": 0}
    return {"p50_s": found.p50, "p95_s": found.p95, "count": found.count}


def _paper() -> Json:
    return {
        "source": paper.SOURCE,
        "hardware": paper.HARDWARE,
        "objects": paper.OBJECTS,
        "scenes": [
            {
                "scene": s.scene,
                "litereality_s": s.litereality_s,
                "garden_s": s.garden_s,
                "ratio": s.ratio,
            }
            for s in (*paper.SCENES, paper.MEAN)
        ],
    }
