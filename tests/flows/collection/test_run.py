"""A collection does what can be done, says why the rest failed, and repeats nothing."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from flows.collection import run as runner
from flows.collection.definition import UnreadableScene
from flows.collection.job import JobOrder
from flows.collection.row import SceneRow
from flows.collection.run import CollectionResult, Options, RowEvent, run_jobs
from flows.collection.state import CollectionState, read_state
from flows.wrong_use import WrongUse
from storage import Store
from tasks.step import Budget
from tests.flows.collection.toy_job import collection, log, toys


@pytest.fixture
def home(tmp_path: Path) -> Path:
    Store.open(tmp_path / "store")
    return tmp_path


def options(home: Path, **values: object) -> Options:
    (home / "slots").mkdir(exist_ok=True)
    budget = Budget((0, 1), 4.0, (), home / "slots")
    given = {"engine": "local", "scenes_at_once": 2, "budget": budget} | values
    return Options(**given)  # type: ignore[arg-type]


def batch(
    home: Path,
    orders: list[JobOrder],
    *unreadable: UnreadableScene,
    on_event: Callable[[RowEvent], None] = runner.tell_nobody,
    **values: object,
) -> CollectionResult:
    given = options(home, **values)
    return run_jobs(collection(home, *unreadable), orders, str(home / "store"), given, on_event)


def rows_of(result: CollectionResult) -> dict[str, SceneRow]:
    return {row.name: row for row in result.rows}


def state_of(home: Path) -> CollectionState:
    state = read_state(home / "out")
    assert state is not None
    return state


def until(true: Callable[[], object], seconds: float = 90.0) -> None:
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "it did not come to pass"
        time.sleep(0.02)


def test_what_can_be_done_is_done_and_what_failed_says_why(home: Path) -> None:
    orders = toys(home, a="", b="fails", c="weak", d="crashes", e="bad plan", f="")
    result = batch(home, orders, UnreadableScene("g", "only one photo in g"))
    rows = rows_of(result)
    assert {name: row.status for name, row in rows.items()} == {
        "a": "ok", "b": "failed", "c": "degraded", "d": "failed", "e": "failed", "f": "ok",
        "g": "failed",
    }  # fmt: skip
    assert result.status == "failed"
    assert rows["b"].reasons == ["the photos of b show nothing"]
    assert "SIGSEGV" in rows["d"].reasons[0]
    assert "a library says farewell" in rows["d"].reasons[0]
    assert rows["e"].reasons == ["the photo a.jpg of this scene is damaged"]
    assert rows["g"].reasons == ["only one photo in g"]
    assert (rows["a"].executed, rows["a"].cached) == (3, 0)
    manifest = json.loads((home / "out" / "failed.json").read_text())
    assert {s["name"]: s["reasons"] for s in manifest["scenes"]} == {
        name: rows[name].reasons for name in "bdeg"
    }
    assert state_of(home).phase == "finished"


def test_nothing_is_computed_twice_and_no_server_or_worker_starts_for_nothing(
    home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    orders = toys(home, a="", b="weak")
    batch(home, orders)
    before = log(home)

    def refuse(*_arguments: object) -> None:
        raise AssertionError("something was started")

    monkeypatch.setattr(runner, "WorkerProcess", refuse)
    monkeypatch.setattr(runner._Runner, "_in_engine", refuse)
    result = batch(home, orders, engine="prefect")
    assert log(home) == before
    assert result.status == "degraded"
    assert [(row.executed, row.cached) for row in result.rows] == [(0, 3), (0, 3)]


def test_only_failed_runs_the_scenes_of_the_manifest_and_keeps_the_other_rows(home: Path) -> None:
    batch(home, toys(home, a="", b="fails", c="fails"))
    orders = toys(home, a="crashes", b="", c="fails")
    result = batch(home, orders, only=("failed",))
    assert {name: row.status for name, row in rows_of(result).items()} == {"b": "ok", "c": "failed"}
    assert state_of(home).rows["a"].status == "ok"
    manifest = json.loads((home / "out" / "failed.json").read_text())
    assert [scene["name"] for scene in manifest["scenes"]] == ["c"]


def test_only_names_scenes_and_an_unknown_one_is_wrong_use(home: Path) -> None:
    orders = toys(home, a="", b="")
    assert [row.name for row in batch(home, orders, only=("b",)).rows] == ["b"]
    assert state_of(home).rows["a"].status == "waiting"
    with pytest.raises(WrongUse, match="called z"):
        batch(home, orders, only=("z",))


def test_a_rerun_that_is_stopped_forgets_no_failure(home: Path) -> None:
    batch(home, toys(home, a="", b="fails", c="fails"))

    def stop(event: RowEvent) -> None:
        if event.kind == "finished":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        batch(home, toys(home, a="", b="", c=""), on_event=stop, only=("failed",), scenes_at_once=1)
    rows = state_of(home).rows
    assert {name: row.status for name, row in rows.items()} == {"a": "ok", "b": "ok", "c": "failed"}
    assert rows["c"].reasons == ["the photos of c show nothing"]
    manifest = json.loads((home / "out" / "failed.json").read_text())
    assert [scene["name"] for scene in manifest["scenes"]] == ["c"]


def test_a_batch_without_workers_is_wrong_use(home: Path) -> None:
    with pytest.raises(WrongUse, match="at once"):
        batch(home, toys(home, a=""), scenes_at_once=0)


def test_only_failed_without_a_manifest_says_so(home: Path) -> None:
    with pytest.raises(WrongUse, match=r"failed\.json"):
        batch(home, toys(home, a=""), only=("failed",))


def test_fail_fast_starts_nothing_after_a_failure(home: Path) -> None:
    orders = toys(home, a="fails", b="", c="")
    result = batch(home, orders, keep_going=False, scenes_at_once=1)
    assert [row.status for row in result.rows] == ["failed", "waiting", "waiting"]
    assert log(home) == ["run a"]
    assert state_of(home).phase == "stopped"


def test_workers_are_renewed(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("flows.collection.worker_process.MOST_JOBS", 1)
    orders = toys(home, a="", b="", c="")
    assert batch(home, orders, scenes_at_once=1).status == "ok"
    lines = (home / "ran.log").read_text().splitlines()
    assert len({line.split()[-1] for line in lines if line.startswith("run")}) == 3


def test_the_state_tells_what_runs_while_it_runs(home: Path) -> None:
    seen: list[CollectionState] = []

    def watch() -> None:
        """Look at the file, as another terminal does, until it tells how far the step is."""
        until((home / "out" / "collection.json").exists)
        until(lambda: [step.share for step in state_of(home).rows["a"].running] == [0.25])
        seen.append(state_of(home))
        (home / "go").touch()

    watcher = threading.Thread(target=watch)
    watcher.start()
    batch(home, toys(home, a="lingers"))
    watcher.join()
    assert seen[0].phase == "running"
    assert seen[0].owner is not None and not seen[0].owner.is_dead()
    row = seen[0].rows["a"]
    assert (row.status, row.executed) == ("running", 3)
    assert (row.running[0].step, row.running[0].doing) == ("linger", "lingering")


def test_two_batches_do_not_write_into_one_folder(home: Path) -> None:
    def second(event: RowEvent) -> None:
        with pytest.raises(WrongUse, match="is running into"):
            batch(home, toys(home, a=""))

    batch(home, toys(home, a=""), on_event=second)


def test_a_folder_that_holds_another_collection_is_left_alone(home: Path) -> None:
    from dataclasses import replace

    batch(home, toys(home, a=""))
    with pytest.raises(WrongUse, match="night"):
        run_jobs(replace(collection(home), name="day"), [], str(home / "store"), options(home))
    assert state_of(home).name == "night"


# -- stopping ---------------------------------------------------------------------------------

BATCH = """
import sys, signal
from pathlib import Path
from tests.flows.collection.test_run import batch
from tests.flows.collection.toy_job import toys
signal.signal(signal.SIGINT, signal.default_int_handler)
home = Path(sys.argv[1])
try:
    batch(home, toys(home, a="", b="lingers", c="lingers", d=""))
except KeyboardInterrupt:
    sys.exit(130)
"""


def start(home: Path) -> subprocess.Popen[bytes]:
    process = subprocess.Popen([sys.executable, "-c", BATCH, str(home)])
    until(lambda: all(child_file(home, name).exists() for name in "bc"))
    until(lambda: all(child_file(home, name).read_text() for name in "bc"))
    return process


def child_file(home: Path, scene: str) -> Path:
    return home / f"go.{scene}.pid"


def is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def everyone(home: Path) -> list[int]:
    """Return the processes of the lingering steps and of the workers."""
    children = [int(child_file(home, name).read_text()) for name in "bc"]
    workers = {int(line.split()[-1]) for line in (home / "ran.log").read_text().splitlines()}
    return [*children, *workers]


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_stopped_batch_leaves_nobody_behind_and_goes_on_later(home: Path, number: int) -> None:
    process = start(home)
    processes = everyone(home)
    process.send_signal(number)
    assert process.wait(timeout=90) == 130
    until(lambda: not any(is_alive(pid) for pid in processes))
    state = state_of(home)
    assert state.phase == "stopped"
    assert [state.rows[name].status for name in "abc"] == ["ok", "stopped", "stopped"]
    goes_on(home)


@pytest.mark.slow
def test_a_killed_batch_takes_its_processes_with_it_and_repeats_no_published_step(
    home: Path,
) -> None:
    process = start(home)
    processes = everyone(home)
    assert state_of(home).phase == "running"
    process.kill()
    process.wait()
    until(lambda: not any(is_alive(pid) for pid in processes))
    state = state_of(home)
    assert state.phase == "stopped (killed)"
    assert state.rows["b"].status == "stopped"
    goes_on(home)


def goes_on(home: Path) -> None:
    """Run the same again: only steps that were not published are executed."""
    published = {line for line in log(home) if line.startswith("link")}
    (home / "ran.log").unlink()
    (home / "go").touch()
    result = batch(home, toys(home, a="", b="lingers", c="lingers", d=""))
    assert result.status == "ok"
    again = {line for line in log(home) if line.startswith("link")}
    assert not published & again
    assert len(published | again) == 12


@pytest.mark.slow
def test_a_killed_worker_fails_only_its_scene(home: Path) -> None:
    def kill_b(event: RowEvent) -> None:
        if event.kind == "progress" and event.row.name == "b" and child_file(home, "b").exists():
            (home / "go").touch()
            lines = (home / "ran.log").read_text().splitlines()
            os.kill(next(int(x.split()[-1]) for x in lines if x.startswith("run b")), 9)

    rows = rows_of(batch(home, toys(home, a="", b="lingers", c=""), on_event=kill_b))
    assert {name: row.status for name, row in rows.items()} == {"a": "ok", "b": "failed", "c": "ok"}
    assert "SIGKILL" in rows["b"].reasons[0]


@pytest.mark.slow
def test_scenes_are_flow_runs_of_one_server_tagged_with_their_collection(
    home: Path, prefect_server: str
) -> None:
    from prefect.client.orchestration import get_client

    orders = toys(home, a="prefect", b="prefect")
    assert batch(home, orders, engine="prefect").status == "ok"
    with get_client(sync_client=True) as client:
        runs = [r for r in client.read_flow_runs() if "collection:night" in r.tags]
    assert {run.name for run in runs} == {"night", "a", "b"}
    assert {run.state_name for run in runs} == {"Completed"}
