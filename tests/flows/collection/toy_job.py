"""Jobs for the tests of the runner: chains of tiny steps that note what really ran."""

from __future__ import annotations

import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flows.collection.definition import Collection, UnreadableScene
from flows.collection.job import JobOrder, JobRun, Report
from garden_models.progress import Progress, silent
from garden_models.scene import BadInput
from storage import Store
from tasks.step import RunContext, run_context, step
from tests.tasks.step.toy import Numbers

STEPS = 3


def _note(log: str, what: str) -> None:
    """Append one line; short appends of several processes do not mix."""
    with Path(log).open("a") as file:
        file.write(f"{what} {os.getpid()}\n")


@step(version=1, skip=("log",), memory_gb=0.5)
def link(number: int, before: Numbers | None, log: str, seconds: float = 0.0) -> Numbers:
    time.sleep(seconds)
    _note(log, f"link {number}")
    return Numbers(np.full(1, float(number)))


@step(version=1, isolated=True, skip=("marker",), memory_gb=0.5)
def linger(scene: str, marker: str, progress: Progress = silent) -> Numbers:
    """Wait until a file is there; it is an isolated step, in a process of its own."""
    Path(f"{marker}.{scene}.pid").write_text(str(os.getpid()))
    progress(0.25, "lingering")
    while not Path(marker).exists():
        time.sleep(0.02)
    return Numbers(np.zeros(1))


@dataclass(frozen=True)
class ToyJob:
    """A scene of three steps; ``does`` names what goes wrong with it."""

    name: str
    number: int
    log: str
    does: str = ""
    marker: str = ""
    seconds: float = 0.0

    def plan(self, store: Store) -> Report | None:
        if self.does == "bad plan":
            raise BadInput("the photo a.jpg of this scene is damaged")
        context = RunContext(store, self.name, "plan")
        with run_context(context):
            self._steps()
        finished = all(entry.action == "cached" for entry in context.plan)
        return self._report(0, len(context.plan)) if finished else None

    def run(self, store: Store, events: JobRun) -> Report:
        _note(self.log, f"run {self.name}")
        if self.does == "fails":
            raise BadInput(f"the photos of {self.name} show nothing")
        if self.does == "crashes":
            print("a library says farewell", flush=True)
            os.kill(os.getpid(), signal.SIGSEGV)
        context = RunContext(
            store,
            self.name,
            "local",
            events,
            budget=events.budget,
            elsewhere=events.elsewhere,
        )
        if self.does == "prefect":
            from flows.prefect_flow import scene_flow

            scene_flow(self.name)(self._run_steps)(context)
        else:
            self._run_steps(context)
        executed = sum(event.outcome == "executed" for event in context.outcomes)
        return self._report(executed, len(context.outcomes) - executed)

    def _run_steps(self, context: RunContext) -> None:
        with run_context(context):
            self._steps()

    def _steps(self) -> None:
        ref = None
        for k in range(STEPS):
            ref = link(10 * self.number + k, ref, self.log, self.seconds)
        if self.does == "lingers":
            linger(self.name, self.marker)

    def _report(self, executed: int, cached: int) -> Report:
        status = "degraded" if self.does == "weak" else "ok"
        reasons = ["few photos"] if self.does == "weak" else []
        return {"status": status, "reasons": reasons, "executed": executed, "cached": cached}


def toy_job(**arguments: Any) -> ToyJob:
    return ToyJob(**arguments)


def toys(home: Path, **does: str) -> list[JobOrder]:
    """Return orders for scenes of these names."""
    return [
        JobOrder(
            name,
            "tests.flows.collection.toy_job:toy_job",
            {
                "name": name,
                "number": number,
                "log": str(home / "ran.log"),
                "does": what,
                "marker": str(home / "go"),
            },
        )
        for number, (name, what) in enumerate(does.items())
    ]


def collection(home: Path, *unreadable: UnreadableScene) -> Collection:
    return Collection("night", (), home / "out", "night.toml", unreadable)


def log(home: Path) -> list[str]:
    """Return what ran, without the processes."""
    path = home / "ran.log"
    return (
        [line.rsplit(" ", 1)[0] for line in path.read_text().splitlines()] if path.exists() else []
    )
