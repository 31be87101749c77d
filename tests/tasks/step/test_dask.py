"""Steps on Dask workers that share only a bucket: once each, retried elsewhere, told as here."""

from __future__ import annotations

import threading
import time
import uuid
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from storage import Store
from storage.bucket import object_prefix
from tasks.step import Ref, RunContext, StepEvent, StepFailed, fan_out, load, run_context
from tasks.step import dask_runner as dask_module
from tasks.step.dask_runner import DaskRunner, RunnerError
from tests.s3_server import BUCKET, S3Server
from tests.storage.media import behind
from tests.tasks.step.dask_cluster import Cluster, dask_cluster
from tests.tasks.step.toil import TARGETS, Toil, collect, prepare, read_file, tallied, toil
from tests.tasks.step.toy import Numbers, Scaling, apart, make

pytestmark = pytest.mark.slow


@pytest.fixture
def cluster(s3: S3Server, tmp_path: Path) -> Iterator[Cluster]:
    """A scheduler and two workers; they know the bucket's server and nothing else of ours."""
    with dask_cluster(tmp_path, workers=2) as running:
        yield running


@pytest.fixture
def store(s3: S3Server) -> Store:
    return Store.open(f"s3://{BUCKET}/{uuid.uuid4().hex}")


def run_scene(
    cluster: Cluster, store: Store, body: Callable[[], Any], engine: Any = "local", **values: Any
) -> tuple[Any, list[StepEvent]]:
    events: list[StepEvent] = []
    with DaskRunner(cluster.address, store.address) as runner:
        _wait_for_workers(runner, len(cluster.workers))
        context = RunContext(
            store, "room", engine, events=events.append, elsewhere=runner, workers=16, **values
        )
        with run_context(context):
            return body(), events


def _wait_for_workers(runner: DaskRunner, count: int) -> None:
    runner._client.wait_for_workers(count, timeout=60)


def flow(numbers: Path, config: Toil) -> Callable[[], tuple[list[Ref | StepFailed], Ref]]:
    """Return a scene with five targets: read here, prepared once, toiled over five times."""

    def body() -> tuple[list[Ref | StepFailed], Ref]:
        prepared = prepare(read_file(str(numbers), config), config)
        objects = fan_out(lambda target: toil(target, prepared, config), TARGETS)
        return objects, collect(tuple(o for o in objects if isinstance(o, Ref)), config)

    return body


@pytest.fixture
def numbers(tmp_path: Path) -> Path:
    """A user's file: only the machine that starts the run needs to have it."""
    place = tmp_path / "numbers.txt"
    place.write_text("1 2 3")
    return place


def test_a_scene_is_computed_once_over_both_workers_and_then_found(
    cluster: Cluster, store: Store, numbers: Path, tmp_path: Path
) -> None:
    tally = tmp_path / "tally"
    body = flow(numbers, Toil(str(tally), seconds=0.5))
    (objects, whole), events = run_scene(cluster, store, body)
    done = tallied(tally)
    assert Counter(what for what, _pid in done) == Counter(
        ["read_file", "prepare", "collect", *(f"toil {t.name}" for t in TARGETS)]
    )
    workers = {worker.pid for worker in cluster.workers}
    assert {pid for what, pid in done if what.startswith("toil")} == workers
    assert {pid for what, pid in done if what == "read_file"}.isdisjoint(workers)
    assert store.read(whole.object, Numbers).values.tolist() == [3.0, 5.0, 7.0] * 5

    told = Counter((e.kind, e.step, e.label) for e in events)
    for target in TARGETS:
        assert told["started", "toil", target.name] == 1
        assert told["progress", "toil", target.name] > 0
        assert told["finished", "toil", target.name] == 1
    finished = [e for e in events if e.kind == "finished"]
    assert {e.outcome for e in finished} == {"executed"}
    assert all(e.why is not None and e.why.code == "new" for e in finished)
    assert all(e.seconds.compute >= 0.5 for e in finished if e.step == "toil")

    (again, same_whole), events = run_scene(cluster, store, body)
    assert tallied(tally) == done
    assert {e.outcome for e in events} == {"cached"}
    assert [ref.content for ref in [*again, same_whole]] == [r.content for r in [*objects, whole]]


def test_a_killed_workers_step_is_done_by_another(
    cluster: Cluster, store: Store, numbers: Path, tmp_path: Path
) -> None:
    tally = tmp_path / "tally"
    config = Toil(str(tally), seconds=2.0)

    def kill_one() -> None:
        workers = {worker.pid: worker for worker in cluster.workers}
        while not (busy := [p for what, p in tallied(tally) if what[:4] == "toil"]):
            time.sleep(0.05)
        workers[busy[0]].kill()
        killed.append(busy[0])

    killed: list[int] = []
    killer = threading.Thread(target=kill_one)
    killer.start()
    (objects, _whole), _events = run_scene(cluster, store, flow(numbers, config))
    killer.join()
    assert all(isinstance(ref, Ref) for ref in objects)
    by_whom = Counter(pid for what, pid in tallied(tally) if what[:4] == "toil")
    assert by_whom[killed[0]] == 1
    assert sum(by_whom.values()) == len(TARGETS) + 1
    assert store.verify() == []


def test_a_step_that_takes_every_worker_with_it_fails_and_is_told(
    cluster: Cluster, store: Store, tmp_path: Path
) -> None:
    """Dask gives up after a few workers; here the last one is gone, so a new one comes."""
    tally = tmp_path / "tally"
    config = Toil(str(tally), how="kill a")
    value = Numbers(np.arange(3.0))
    for _ in range(4):
        cluster.add_worker()

    def body() -> Ref:
        return toil(TARGETS[0], prepare(value, config), config)

    with pytest.raises(StepFailed, match="no Dask worker finished") as caught:
        run_scene(cluster, store, body)
    assert caught.value.kind == "KilledWorker"
    assert caught.value.retryable
    assert len({pid for what, pid in tallied(tally) if what == "toil a"}) >= 3


def test_a_failure_comes_back_as_it_was_and_stops_no_other(
    cluster: Cluster, store: Store, numbers: Path, tmp_path: Path
) -> None:
    body = flow(numbers, Toil(str(tmp_path / "tally"), how="b"))
    (objects, _whole), events = run_scene(cluster, store, body)
    failures = [outcome for outcome in objects if isinstance(outcome, StepFailed)]
    assert [(f.step, f.label, f.kind, f.retryable) for f in failures] == [
        ("toil", "b", "BadInput", False)
    ]
    assert failures[0].reason == "the box of b lies outside of a.jpg: correct it"
    assert [e.error for e in events if e.outcome == "failed"] == [failures[0].reason]
    assert sum(isinstance(outcome, Ref) for outcome in objects) == 4


def test_isolated_steps_are_children_of_the_worker(
    cluster: Cluster, store: Store, numbers: Path
) -> None:
    def body() -> list[Ref | StepFailed]:
        value = make(3)
        return fan_out(lambda note: apart(value, Scaling(1.0, note)), ("", "segfault"))

    (fine, crashed), events = run_scene(cluster, store, body)
    assert load_of(store, fine) == [1.0, 2.0, 3.0]
    assert crashed.kind == "StepCrashed"
    assert "SIGSEGV" in crashed.reason
    assert [e.doing for e in events if e.kind == "progress" and e.doing == "half"] != []


def test_a_stopped_run_stops_its_workers(
    cluster: Cluster, store: Store, numbers: Path, tmp_path: Path
) -> None:
    tally = tmp_path / "tally"
    events: list[StepEvent] = []
    with DaskRunner(cluster.address, store.address) as runner:
        context = RunContext(store, "room", elsewhere=runner, events=events.append)

        def stop() -> None:
            while not any(what[:4] == "toil" for what, _pid in tallied(tally)):
                time.sleep(0.05)
            context.cancelled.set()

        stopper = threading.Thread(target=stop)
        stopper.start()
        with run_context(context), pytest.raises(StepFailed) as caught:
            value = prepare(Numbers(np.arange(3.0)), Toil(str(tally)))
            toil(TARGETS[0], value, Toil(str(tally), seconds=600))
        stopper.join()
        assert caught.value.kind == "Cancelled"
        deadline = time.monotonic() + 60
        while any(runner._client.processing().values()) or behind(store).names("leases/"):
            assert time.monotonic() < deadline
            time.sleep(0.1)


def test_a_damaged_input_is_made_again(cluster: Cluster, store: Store, tmp_path: Path) -> None:
    config = Toil(str(tmp_path / "tally"))

    def body() -> Ref:
        value = prepare(Numbers(np.arange(3.0)), config)
        for name in behind(store).names(object_prefix(value.object)):
            if name.rpartition("/")[2].startswith("c."):
                behind(store).put(name, behind(store).get(name)[::-1])
        return toil(TARGETS[0], value, config)

    ref, _events = run_scene(cluster, store, body)
    assert store.read(ref.object, Numbers).values.tolist() == [1.0, 3.0, 5.0]
    assert [what for what, _pid in tallied(tmp_path / "tally")] == ["prepare", "prepare", "toil a"]


def test_single_flight_over_two_runs(
    cluster: Cluster, store: Store, numbers: Path, tmp_path: Path
) -> None:
    tally = tmp_path / "tally"
    body = flow(numbers, Toil(str(tally), seconds=0.3))
    runs = [threading.Thread(target=run_scene, args=(cluster, store, body)) for _ in range(2)]
    for run in runs:
        run.start()
    for run in runs:
        run.join()
    toiled = Counter(what for what, _pid in tallied(tally) if what[:4] == "toil")
    assert toiled == Counter(f"toil {t.name}" for t in TARGETS)


def test_with_prefect_the_task_runs_are_the_same(
    prefect_server: str, cluster: Cluster, store: Store, numbers: Path, tmp_path: Path
) -> None:
    """The task runs are those of this process; workers need no Prefect server."""
    from prefect import flow as prefect_flow

    body = flow(numbers, Toil(str(tmp_path / "tally")))
    whole = prefect_flow(lambda: body()[1], name="toil", persist_result=False)
    ref, events = run_scene(cluster, store, whole, engine="prefect")
    assert load_of(store, ref) == [3.0, 5.0, 7.0] * 5
    assert sum(e.kind == "finished" for e in events) == 8


def load_of(store: Store, ref: Ref) -> list[float]:
    with run_context(RunContext(store, "room")):
        values: list[float] = load(ref, Numbers).values.tolist()
        return values


def test_a_folder_of_this_machine_is_refused_for_workers_on_others(
    cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = Store.open(tmp_path / "store", durability="none")
    config = Toil(str(tmp_path / "tally"))
    with DaskRunner(cluster.address, store.address) as here:  # the workers are on this machine
        with run_context(RunContext(store, "room", elsewhere=here)):
            prepare(Numbers(np.arange(3.0)), config)
        monkeypatch.setattr("socket.gethostname", lambda: "desk")
        with (
            run_context(RunContext(store, "room", elsewhere=here)),
            pytest.raises(StepFailed, match="another machine"),
        ):
            prepare(Numbers(np.arange(4.0)), config)
    with (
        pytest.raises(RunnerError, match="--shared-store"),
        DaskRunner(cluster.address, store.address),
    ):
        pass
    with (
        DaskRunner(cluster.address, store.address, shared=True) as shared,
        run_context(RunContext(store, "room", elsewhere=shared)),
    ):
        prepare(Numbers(np.arange(5.0)), config)


def test_nobody_at_the_address_is_said_at_once(
    s3: S3Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dask_module, "_CONNECT_S", 1.0)
    monkeypatch.setattr(dask_module, "_FIRST_WORKER_S", 1.0)
    with pytest.raises(RunnerError, match="no Dask scheduler answers"):
        DaskRunner("tcp://127.0.0.1:9", "s3://garden/x").__enter__()
    with dask_cluster(tmp_path, workers=0) as empty, pytest.raises(RunnerError, match="no workers"):
        DaskRunner(empty.address, "s3://garden/x").__enter__()
