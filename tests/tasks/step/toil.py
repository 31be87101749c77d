"""Steps for the tests of workers elsewhere: slow on demand, and each run leaves a line."""

from __future__ import annotations

import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from garden_models.progress import Progress, silent
from garden_models.scene import BadInput, Target
from tasks.step import step
from tests.tasks.step.toy import Numbers

TARGETS = tuple(Target(name, "a.jpg", (0.0, 0.0, 1.0, 1.0)) for name in "abcde")


@dataclass(frozen=True)
class Toil:
    """``tally`` gets a line a run: the step, its target, the process."""

    tally: str
    seconds: float = 0.0
    how: str = ""


def tallied(tally: Path) -> list[tuple[str, int]]:
    lines = tally.read_text().splitlines() if tally.exists() else []
    return [(line.rpartition(" ")[0], int(line.rpartition(" ")[2])) for line in lines]


def _note(config: Toil, what: str) -> None:
    with Path(config.tally).open("a") as file:
        file.write(f"{what} {os.getpid()}\n")


@step(version=1, here=True)
def read_file(path: str, config: Toil) -> Numbers:
    _note(config, "read_file")
    return Numbers(np.array([float(word) for word in Path(path).read_text().split()]))


@step(version=1)
def prepare(numbers: Numbers, config: Toil) -> Numbers:
    _note(config, "prepare")
    return Numbers(numbers.values * 2)


@step(version=1)
def toil(target: Target, numbers: Numbers, config: Toil, progress: Progress = silent) -> Numbers:
    _note(config, f"toil {target.name}")
    until = time.monotonic() + config.seconds
    while time.monotonic() < until:
        progress(0.5, "toiling")
        time.sleep(0.02)
    if config.how == target.name:
        raise BadInput(f"the box of {target.name} lies outside of a.jpg: correct it")
    if config.how == f"kill {target.name}":
        os.kill(os.getpid(), signal.SIGKILL)
    return Numbers(numbers.values + len(target.name))


@step(version=1)
def collect(parts: tuple[Numbers, ...], config: Toil) -> Numbers:
    _note(config, "collect")
    return Numbers(np.concatenate([part.values for part in parts]))
