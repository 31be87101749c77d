"""A spare child computes as a fresh one does, only sooner, and never outlives its run."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path

import numpy as np
import pytest

from storage import Store
from tasks.step import RunContext, SpareChild, run_context, step
from tasks.step.start_child import StartedChild
from tests.tasks.step.test_isolate import alive, wait_for
from tests.tasks.step.toy import Numbers, Scaling, apart, make


@pytest.fixture
def spare(store: Store) -> Iterator[SpareChild]:
    child = SpareChild(store)
    yield child
    child.close()


def prepared(spare: SpareChild) -> StartedChild:
    """Return the child that stands ready, without taking it."""
    spare.prepare()
    started = spare._spare
    assert isinstance(started, Future)
    return started.result()


@step(version=1, isolated=True, time_limit_s=20.0)
def who(note: str) -> Numbers:
    """Return the number of the process, and of bytes to be had from standard input."""
    return Numbers(np.array([float(os.getpid()), float(len(sys.stdin.read()))]))


def test_the_spare_child_computes_and_the_next_one_is_prepared(
    store: Store, spare: SpareChild
) -> None:
    ready = prepared(spare)
    with run_context(RunContext(store, "room", spare=spare)):
        value = store.read(who("x").object, Numbers)
        following = prepared(spare)
    assert value.values.tolist() == [ready.child.process.pid, 0.0]
    assert following.child.process.pid != ready.child.process.pid
    assert not alive(ready.child.process.pid)
    spare.close()
    assert not alive(following.child.process.pid)
    assert list((store.path / "tmp").iterdir()) == []


def test_it_gives_what_a_fresh_child_gives(store: Store, spare: SpareChild) -> None:
    with run_context(RunContext(store, "room", spare=spare)):
        sooner = apart(make(3), Scaling())
    with run_context(RunContext(store, "room", force=frozenset({"apart"}))):
        assert apart(make(3), Scaling()).content == sooner.content


@pytest.mark.parametrize("what", ["dies", "has another environment", "is in another folder"])
def test_one_that_would_not_do_is_replaced(
    store: Store,
    spare: SpareChild,
    what: str,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    ready = prepared(spare)
    if what == "dies":
        ready.child.process.kill()
        ready.child.process.wait()
    elif what == "is in another folder":
        monkeypatch.chdir(tmp_path)
    else:
        monkeypatch.setenv("GARDEN_SOMETHING", "new")
    with run_context(RunContext(store, "room", spare=spare)):
        value = store.read(who("x").object, Numbers)
    assert value.values[0] != ready.child.process.pid
    assert not alive(ready.child.process.pid)


def test_its_time_counts_from_its_order(store: Store, spare: SpareChild) -> None:
    ready = prepared(spare)
    ready.child.started = time.monotonic() - 1000.0
    with run_context(RunContext(store, "room", spare=spare)):
        assert who("x").outcome == "executed"


PARENT = """
import sys, time
from storage import Store
from tasks.step import SpareChild
spare = SpareChild(Store.open(sys.argv[1]))
spare.prepare()
print(spare._spare.result().child.process.pid, flush=True)
time.sleep(600)
"""


def test_it_dies_with_its_parent(store: Store) -> None:
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT, str(store.path)],
        env=os.environ | {"PYTHONPATH": ":".join(sys.path)},
        stdout=subprocess.PIPE,
    )
    assert parent.stdout is not None
    child = int(parent.stdout.readline())
    assert alive(child)
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    wait_for(lambda: not alive(child))
    parent.stdout.close()
