"""Let two processes want one key; kill the one that computes; let it be on another machine."""

from __future__ import annotations

import dataclasses
import os
import random
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from storage import Store
from storage.leases import Lease
from storage.owner import Owner
from tasks.step import RunContext, run_context, step
from tests.faults.forks import fork, in_own_process, kill, print_counts, tell, told, wait
from tests.faults.part import Count, part
from tests.tasks.step.toy import Numbers

SEED = 3
WHOLE = 40
PATIENCE_S = 60.0
TERM_S = 0.4  # of a lease whose owner is on another machine


@step(version=1)
def slow(log: str, seconds: float) -> Numbers:
    tell(Path(log), f"executed {os.getpid()}")
    time.sleep(seconds)
    return Numbers(np.ones(3))


def run(path: Path, log: Path, seconds: float) -> None:
    """Run the step and tell how it came out, as one of several workers does."""
    with run_context(RunContext(Store.open(path), "room")):
        ref = slow(str(log), seconds)
    tell(log, f"finished {os.getpid()} {ref.outcome} {ref.content}")


def both_finish(path: Path, log: Path, chance: random.Random) -> Iterator[str]:
    """Two that begin at once: one executes, both have the result."""
    seconds = chance.uniform(0.0, 0.2)
    children = [fork(lambda: run(path, log, seconds), log) for _ in range(2)]
    late = wait(children, PATIENCE_S)
    said = told(log)
    if late:
        yield "one waited without end"
    yield from _wrong(said, executed=1, finished=2)


def owner_dies(path: Path, log: Path, chance: random.Random) -> Iterator[str]:
    """The one that executes is killed: the other takes over and executes."""
    children = [fork(lambda: run(path, log, 0.3), log) for _ in range(2)]
    deadline = time.monotonic() + PATIENCE_S
    while not log.exists() and time.monotonic() < deadline:
        time.sleep(0.005)
    time.sleep(chance.uniform(0.0, 0.1))
    owner = int(log.read_text().split()[1]) if log.exists() else children[0]
    kill(owner)
    late = wait([child for child in children if child != owner], PATIENCE_S)
    if late:
        yield "the other waited without end"
    yield from _wrong(told(log), executed=2, finished=1)


def owner_stops(path: Path, log: Path, chance: random.Random) -> Iterator[str]:
    """The owner hangs (SIGSTOP): its lease ends, the other takes over; both agree later."""
    store = Store.open(path, lease_s=TERM_S)
    owner = fork(lambda: _run_with(store, log, 0.2), log)
    deadline = time.monotonic() + PATIENCE_S
    while not log.exists() and time.monotonic() < deadline:
        time.sleep(0.005)
    os.kill(owner, signal.SIGSTOP)
    other = fork(lambda: _run_with(store, log, 0.0), log)
    late = wait([other], PATIENCE_S)
    os.kill(owner, signal.SIGCONT)
    late += wait([owner], PATIENCE_S)
    if late:
        yield "one waited without end"
    yield from _wrong(told(log), executed=2, finished=2)


def owner_elsewhere(path: Path, log: Path, chance: random.Random) -> Iterator[str]:
    """The owner was on a machine that is gone: its lease ends with its term, not before."""
    store = Store.open(path, lease_s=TERM_S)
    with run_context(RunContext(store, "room", "plan")):
        key = slow(str(log), 0.0).key
    away = dataclasses.replace(Owner.here(), host="elsewhere", boot_id="another", pid=1)
    until = time.time() + TERM_S
    store.medium.create(f"leases/{key[3:]}.json", Lease(key, "t", away, until).to_bytes())
    late = wait([fork(lambda: _run_with(store, log, 0.0), log)], PATIENCE_S)
    if late:
        yield "the other waited without end"
    if time.time() < until:
        yield "the lease was taken over while it was valid"
    yield from _wrong(told(log), executed=1, finished=1)


def _run_with(store: Store, log: Path, seconds: float) -> None:
    with run_context(RunContext(Store.open(store.path, lease_s=TERM_S), "room")):
        ref = slow(str(log), seconds)
    tell(log, f"finished {os.getpid()} {ref.outcome} {ref.content}")


def _wrong(said: list[str], *, executed: int, finished: int) -> Iterator[str]:
    times = sum(line.startswith("executed") for line in said)
    results = [line.split()[3] for line in said if line.startswith("finished")]
    if times != executed:
        yield f"executed {times} times instead of {executed}: {said}"
    if len(results) != finished or len(set(results)) != 1:
        yield f"{len(results)} results instead of {finished}: {said}"
    yield from (line for line in said if not line.startswith(("executed", "finished")))


WAYS = (both_finish, owner_dies, owner_stops, owner_elsewhere)


def fly(folder: Path, trials: int) -> list[Count]:
    """Do each so often, each time on a new store."""
    chance = random.Random(SEED)
    counts = []
    for way in WAYS:
        found: list[str] = []
        for number in range(trials):
            path = folder / f"{way.__name__}{number}"
            Store.open(path, durability="none")
            found += (f"trial {number}: {v}" for v in way(path, folder / "told", chance))
            found += map(str, Store.open(path).verify())
        counts.append(Count(way.__name__.replace("_", " "), trials, tuple(found)))
    return counts


@part("single flight")
def whole(folder: Path) -> list[Count]:
    return in_own_process("single_flight", str(folder), str(WHOLE))


if __name__ == "__main__":
    print_counts(fly(Path(sys.argv[1]), int(sys.argv[2])))
