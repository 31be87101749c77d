"""Carry a scene's timings from the process that measured them, as JSON."""

from __future__ import annotations

import dataclasses
from typing import Any

from flows.benchmark.latency.timing import SceneTiming, StepTiming
from tasks.step import Seconds

Json = dict[str, Any]


def timing_to_json(timing: SceneTiming) -> Json:
    """Return a scene's timing as JSON."""
    return dataclasses.asdict(timing)


def timing_from_json(document: Json) -> SceneTiming:
    """Return what ``timing_to_json`` was given."""
    steps = [
        StepTiming(**{**step, "seconds": Seconds(**step["seconds"]) if step["seconds"] else None})
        for step in document["steps"]
    ]
    lists = {name: tuple(document[name]) for name in ("objects", "missing")}
    return SceneTiming(**{**document, **lists, "steps": tuple(steps)})
