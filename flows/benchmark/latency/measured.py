"""Measure a scene cold, cached and warm, in fresh processes and a store of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

from flows.benchmark.latency.timing import SceneTiming
from flows.benchmark.latency.wire import timing_from_json
from flows.collection.scene_job import scene_order
from flows.scene_run import SceneRequest
from storage.redact import redact

Engine = Literal["prefect", "local"]

LONGEST_S = 24 * 3600.0
"""After this a measurement is ended; steps that hang are ended by their own limits."""

_TAIL = 2000  # characters of what a process said last


@dataclass(frozen=True)
class Measurement:
    """How scenes are measured: with which engine, how often, and where there is room.

    ``folder`` takes the throw-away stores and packages, so it should be on the disk that
    the real store is on.
    """

    folder: Path
    engine: Engine = "prefect"
    repeat: int = 1


class MeasurementFailed(OSError):
    """The process that ran a scene ended without an answer."""


def measured_timings(request: SceneRequest, how: Measurement) -> list[SceneTiming]:
    """Run the scene ``repeat`` times from an empty store; return all three modes of each.

    Each repetition starts one process, which executes the scene (cold) and once more
    (warm), and then a second one, which finds everything in the store (cached). A scene
    that did not finish has no ``cached`` and no ``warm``.

    Raises:
        MeasurementFailed: a process died; what it said last is part of the message.
    """
    timings = []
    how.folder.mkdir(parents=True, exist_ok=True)
    for number in range(1, how.repeat + 1):
        with TemporaryDirectory(prefix=".latency-", dir=how.folder) as room:
            executed = in_fresh_process("execute", request, number, how, Path(room))
            timings += executed
            if all(timing.complete for timing in executed):
                timings += in_fresh_process("rerun", request, number, how, Path(room))
    return timings


def in_fresh_process(
    task: str, request: SceneRequest, number: int, how: Measurement, room: Path
) -> list[SceneTiming]:
    """Have a process of its own do ``execute`` or ``rerun`` in ``room``; return its timings."""
    order: dict[str, Any] = {
        "task": task,
        "request": scene_order(request).arguments,
        "store": str(room / "store"),
        "packages": str(room / "packages"),
        "engine": how.engine,
        "repeat": number,
        "answer": str(room / "answer.json"),
    }
    command = [sys.executable, "-m", "flows.benchmark.latency.scene_process", str(room)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    said = room / "said.txt"
    with said.open("wb") as output:
        order["started"] = time.monotonic()
        (room / "order.json").write_text(json.dumps(order))
        ended = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            env=environment,
            timeout=LONGEST_S,
            check=False,
        )
    if ended.returncode:
        tail = redact(said.read_text(errors="replace"))[-_TAIL:].strip()
        raise MeasurementFailed(
            f"{request.name}: its process ended with code {ended.returncode}; it said last: {tail}"
        )
    return [timing_from_json(t) for t in json.loads((room / "answer.json").read_text())]
