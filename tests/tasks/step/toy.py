"""Steps for the tests of the step shell: tiny nouns, and a count of what really ran."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from garden_models.progress import Progress, silent
from garden_models.scene import OK, BadInput, Target, Verdict
from storage import Store
from tasks.step import Ref, RunContext, run_context, step, step_scratch

ran: list[str] = []


@dataclass(frozen=True)
class Numbers:
    SCHEMA: ClassVar[str] = "test.Numbers/1"
    values: np.ndarray
    verdict: Verdict = OK


@dataclass(frozen=True)
class Scaling:
    factor: float = 2.0
    note: str = ""


@step(version=1)
def make(count: int) -> Numbers:
    ran.append("make")
    return Numbers(np.arange(count, dtype=np.float64))


@step(version=1)
def scale(numbers: Numbers, config: Scaling) -> Numbers:
    ran.append("scale")
    return Numbers(numbers.values * config.factor)


@step(version=1)
def pick(target: Target, numbers: Numbers, progress: Progress = silent) -> Numbers:
    ran.append(f"pick {target.name}")
    progress(0.5, "picking")
    if target.name == "bad":
        raise BadInput("the box of bad lies outside of a.jpg: correct it")
    status = "degraded" if target.name == "weak" else "ok"
    return Numbers(numbers.values[:2], Verdict(status, ("few",) if status != "ok" else ()))


@step(version=1)
def gather(parts: tuple[Numbers, ...], extra: Numbers | None = None) -> Numbers:
    ran.append("gather")
    more = () if extra is None else (extra.values,)
    return Numbers(np.concatenate([part.values for part in parts] + list(more)))


@step(version=1, isolated=True, time_limit_s=60.0, memory_limit_gb=8.0)
def apart(numbers: Numbers, config: Scaling, progress: Progress = silent) -> Numbers:
    progress(0.5, "half")
    print("a library talks")
    if config.note == "bad":
        raise BadInput("a sentence")
    if config.note == "bug":
        raise KeyError("missing")
    if config.note == "segfault":
        os.kill(os.getpid(), signal.SIGSEGV)
    with step_scratch() as folder:
        (folder / "x").write_text("1")
    return Numbers(numbers.values + 1)


@step(version=1, isolated=True, memory_limit_gb=0.4)
def hoard(count: int) -> Numbers:
    arrays = [np.ones(10_000_000) for _ in range(count)]
    time.sleep(30)
    return Numbers(arrays[0][:1])


@step(version=1, isolated=True, time_limit_s=3.0)
def dawdle(marker: str) -> Numbers:
    Path(marker).write_text(str(os.getpid()))
    time.sleep(30)
    return Numbers(np.zeros(1))


spins: list[int] = []
_spinning = [0]
_spin_guard = threading.Lock()


@step(version=1, memory_gb=0.5)
def spin(number: int) -> Numbers:
    """Take a moment, and note how many do so at once."""
    with _spin_guard:
        _spinning[0] += 1
        spins.append(_spinning[0])
    time.sleep(0.2)
    with _spin_guard:
        _spinning[0] -= 1
    return Numbers(np.full(1, float(number)))


def fan(count: int, first: int = 0) -> list[Ref]:
    futures = [spin.submit(first + number) for number in range(count)]
    return [future.result() for future in futures]


def target(name: str) -> Target:
    return Target(name, "a.jpg", (0.0, 0.0, 1.0, 1.0))


def in_run(store: Store, body: Callable[[], Any], engine: Any = "local", **values: Any) -> Any:
    """Run ``body`` in a fresh run; give its result and the run."""
    context = RunContext(store, values.pop("scene", "room"), engine, **values)
    with run_context(context):
        return body(), context


def chain(factor: float = 2.0, count: int = 4) -> Ref:
    return pick(target("bulldozer"), scale(make(count), Scaling(factor)))
