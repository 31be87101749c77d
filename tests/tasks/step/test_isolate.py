"""Isolated steps: typed errors, limits that hold, and children that never outlive their run."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from storage import Store
from tasks.step import Ref, RunContext, StepEvent, StepFailed, load, run_context
from tests.s3_server import BUCKET, S3Server
from tests.storage.media import behind, files_of
from tests.tasks.step.toy import Numbers, Scaling, apart, dawdle, hoard, in_run, make


def alive(pid: int) -> bool:
    try:
        status = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return False
    return status[status.rindex(")") + 2] != "Z"


def wait_for(condition: Any, seconds: float = 60.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it did not happen in time"
        time.sleep(0.05)


def failing(store: Store, note: str) -> StepFailed:
    with pytest.raises(StepFailed) as caught, run_context(RunContext(store, "room")):
        apart(make(3), Scaling(1.0, note))
    return caught.value


def test_a_child_computes_and_publishes(store: Store) -> None:
    events: list[StepEvent] = []
    with run_context(RunContext(store, "room", events=events.append)):
        ref = apart(make(3), Scaling())
        value = load(ref, Numbers)
        again = apart(make(3), Scaling())
    assert value.values.tolist() == [1.0, 2.0, 3.0]
    assert again.outcome == "cached"
    assert [e.doing for e in events if e.kind == "progress"] == ["half"]
    assert ref.peak_mb > 20
    assert list((store.path / "tmp").iterdir()) == []
    with run_context(RunContext(store, "room", isolate=False, force=frozenset({"apart"}))):
        assert apart(make(3), Scaling()).content == ref.content


def test_errors_come_back_typed(store: Store) -> None:
    failure = failing(store, "bad")
    assert (failure.kind, failure.reason) == ("BadInput", "a sentence")
    failure = failing(store, "bug")
    assert (failure.kind, failure.reason) == ("StepCrashed", "KeyError: 'missing'")
    assert "in apart" in failure.__cause__.__notes__[0]
    failure = failing(store, "segfault")
    assert failure.kind == "StepCrashed"
    assert "SIGSEGV" in failure.reason
    assert "a library talks" in failure.reason


def test_the_time_limit_holds(store: Store, tmp_path: Path) -> None:
    started = time.monotonic()
    with pytest.raises(StepFailed) as caught, run_context(RunContext(store, "room")):
        dawdle(str(tmp_path / "pid"))
    assert caught.value.kind == "TimeLimit"
    assert "stopped after 3 s" in caught.value.reason
    assert time.monotonic() - started < 120
    if (tmp_path / "pid").exists():
        assert not alive(int((tmp_path / "pid").read_text()))


def test_the_memory_limit_holds(store: Store) -> None:
    with pytest.raises(StepFailed) as caught, run_context(RunContext(store, "room")):
        hoard(10)
    assert caught.value.kind == "MemoryLimit"
    assert "limit of 0.4 GB" in caught.value.reason


PARENT = """
import signal, sys
from storage import Store
from tasks.step import Ref, RunContext, run_context
from tests.tasks.step.toy import dawdle
signal.signal(signal.SIGINT, getattr(signal, sys.argv[4]))
with run_context(RunContext(Store.open(sys.argv[1]), "room")):
    if sys.argv[3] == "submit":
        dawdle.submit(sys.argv[2]).result()
    dawdle(sys.argv[2])
"""


@pytest.mark.parametrize(
    ("number", "how"),
    [
        (signal.SIGINT, "call"),
        (signal.SIGINT, "submit"),
        (signal.SIGTERM, "call"),
        (signal.SIGKILL, "call"),
    ],
)
def test_children_end_with_their_run(
    store: Store, tmp_path: Path, number: signal.Signals, how: str
) -> None:
    marker = tmp_path / "pid"
    environment = os.environ | {"PYTHONPATH": ":".join(sys.path)}
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT, str(store.path), str(marker), how, "default_int_handler"],
        env=environment,
        stderr=subprocess.DEVNULL,
    )
    try:
        wait_for(lambda: marker.exists() and marker.read_text())
        child = int(marker.read_text())
        parent.send_signal(number)
        wait_for(lambda: not alive(child))
        assert parent.wait(60.0) != 0
    finally:
        parent.kill()


def test_ctrl_c_for_others_does_not_stop_a_background_job(store: Store, tmp_path: Path) -> None:
    """A shell has its background jobs ignore it."""
    marker = tmp_path / "pid"
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT, str(store.path), str(marker), "call", "SIG_IGN"],
        env=os.environ | {"PYTHONPATH": ":".join(sys.path)},
        stderr=subprocess.DEVNULL,
    )
    try:
        wait_for(lambda: marker.exists() and marker.read_text())
        parent.send_signal(signal.SIGINT)
        time.sleep(0.5)
        assert alive(int(marker.read_text()))
        assert parent.poll() is None
    finally:
        parent.kill()


def test_single_flight_between_processes_and_take_over(store: Store, tmp_path: Path) -> None:
    """The owner of a key is killed; who waits for it computes instead."""
    code = (
        "import sys, time; from storage import Store\n"
        "store = Store.open(sys.argv[1])\n"
        "from tasks.step import Ref, RunContext, run_context\n"
        "from tests.tasks.step import toy\n"
        "key = toy.make._call(RunContext(store, 'room'), {'count': 7}, None)\n"
        "key = toy.make.key_parts(key.arguments).key\n"
        "assert store.acquire(key); print('held', flush=True); time.sleep(60)"
    )
    environment = os.environ | {"PYTHONPATH": ":".join(sys.path)}
    owner = subprocess.Popen(
        [sys.executable, "-c", code, str(store.path)], env=environment, stdout=subprocess.PIPE
    )
    try:
        assert owner.stdout is not None
        assert owner.stdout.readline() == b"held\n"
        refs: list[Any] = []

        def run() -> None:
            with run_context(RunContext(store, "room")):
                refs.append(make(7))

        waiter = threading.Thread(target=run)
        waiter.start()
        time.sleep(0.4)
        assert refs == []
        owner.kill()
        owner.wait()
        waiter.join(5.0)
        assert refs[0].outcome == "executed"
        assert store.action(refs[0].key).seconds["wait"] > 0.3
    finally:
        owner.kill()


def test_a_child_works_in_a_store_in_a_bucket(s3: S3Server) -> None:
    store = Store.open(f"s3://{BUCKET}/isolated")
    ref, _run = in_run(store, lambda: apart(make(3), Scaling()))
    assert store.read(ref.object, Numbers).values.tolist() == [1.0, 2.0, 3.0]
    assert in_run(store, lambda: apart(make(3), Scaling()))[0].outcome == "cached"
    with pytest.raises(StepFailed, match="a sentence"):
        in_run(store, lambda: apart(make(3), Scaling(note="bad")))


@pytest.mark.parametrize("damage", ["changed", "removed"])
def test_hit_means_verified_an_input_that_a_child_finds_damaged_is_made_again(
    store: Store, damage: str
) -> None:
    def body() -> Ref:
        value = make(3)
        there = behind(store)
        for name in files_of(store, value.object):
            if name.rpartition("/")[2].startswith("c."):
                there.put(name, there.get(name)[::-1])
            elif damage == "removed":
                there.delete(name)
        return apart(value, Scaling())

    ref, run = in_run(store, body)
    assert store.read(ref.object, Numbers).values.tolist() == [1.0, 2.0, 3.0]
    assert [(e.step, e.outcome) for e in run.outcomes] == [
        ("make", "executed"),
        ("make", "executed"),
        ("apart", "executed"),
    ]
    assert store.verify("full") == []
