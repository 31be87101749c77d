"""Run a collection: what is finished is seen in the store, the rest goes to worker processes."""

from __future__ import annotations

import dataclasses
import heapq
import os
import select
import sys
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from flows.collection.definition import Collection
from flows.collection.job import JobOrder
from flows.collection.page import write_page
from flows.collection.passes import Priority, passes_made, postponed, priority
from flows.collection.row import RunningStep, SceneRow, Status, worst_status
from flows.collection.scene_job import scene_order
from flows.collection.state import (
    CollectionState,
    end_running,
    failed_names,
    only_runner,
    read_state,
)
from flows.collection.stopping import stop_on_terminate
from flows.collection.worker import WorkerSetting, failure_reason
from flows.collection.worker_process import GRACE_S, WorkerProcess
from flows.step_runner import HERE, Runner
from flows.wrong_use import WrongUse
from storage import Store
from storage.owner import Owner
from tasks.step import Budget

ONLY_FAILED = "failed"
GB_A_SCENE = 2.0
_POLL_S = 0.2

Engine = Literal["prefect", "local"]


@dataclass(frozen=True)
class RowEvent:
    """Something that happened to a scene; its row says what is known now."""

    kind: Literal["planned", "started", "progress", "finished"]
    row: SceneRow


@dataclass(frozen=True)
class CollectionResult:
    """The rows of the scenes that were asked for, and the worst status of them."""

    rows: tuple[SceneRow, ...]
    status: Status


@dataclass(frozen=True)
class Options:
    """How a collection is run; see ``run_collection``."""

    engine: Engine = "prefect"
    scenes_at_once: int | None = None
    only: tuple[str, ...] = ()
    keep_going: bool = True
    budget: Budget | None = None
    runner: Runner = HERE


def tell_nobody(event: RowEvent) -> None:
    """Ignore an event."""


def run_collection(
    collection: Collection,
    store_address: str,
    *,
    engine: Engine = "prefect",
    scenes_at_once: int | None = None,
    only: Sequence[str] = (),
    keep_going: bool = True,
    budget: Budget | None = None,
    runner: Runner = HERE,
    on_event: Callable[[RowEvent], None] = tell_nobody,
) -> CollectionResult:
    """Run all scenes of a collection that are not finished; return what came of all.

    The state is in ``OUT/collection.json`` while it runs and afterwards, the scenes that
    failed in ``OUT/failed.json``.

    Args:
        collection: from ``read_collection``.
        store_address: what ``Store.open`` takes.
        engine: ``prefect`` (every scene is a flow run) or ``local``.
        scenes_at_once: worker processes; as many as cores and memory allow if not given.
        only: names of scenes, or ``failed`` for those of ``failed.json``.
        keep_going: whether a scene that failed leaves the others alone.
        budget: what all steps together may use; the machine if not given.
        runner: who computes the steps; this machine if not given.
        on_event: called in this thread whenever a scene's row changed.

    Raises:
        WrongUse: an unknown name, another batch in the same folder.
        KeyboardInterrupt: stopped by Ctrl-C or SIGTERM; the state says so.
    """
    here = runner.name is None
    orders = [scene_order(request, models_here=here) for request in collection.scenes]
    options = Options(engine, scenes_at_once, tuple(only), keep_going, budget, runner)
    return run_jobs(collection, orders, store_address, options, on_event)


def run_jobs(
    collection: Collection,
    orders: Iterable[JobOrder],
    store_address: str,
    options: Options,
    on_event: Callable[[RowEvent], None] = tell_nobody,
) -> CollectionResult:
    """Run any jobs as the scenes of a collection, whose ``scenes`` are not looked at."""
    jobs = {order.name: order for order in orders}
    if options.scenes_at_once is not None and options.scenes_at_once < 1:
        raise WrongUse(f"{options.scenes_at_once} scenes at once cannot be: give 1 or more")
    with only_runner(collection.out), stop_on_terminate():
        state = _fresh_state(collection, jobs, store_address)
        chosen = chosen_names(options.only, state.name, state.rows, state.out)
        budget = options.budget or Budget.of_machine()
        state.scenes_at_once = options.scenes_at_once or scenes_that_fit(budget)
        return _Runner(state, jobs, chosen, options, budget, on_event).run()


def scenes_that_fit(budget: Budget) -> int:
    """Return how many scenes keep a budget full: one a core, as far as memory goes."""
    return max(1, min(len(budget.cores), int(budget.memory_gb / GB_A_SCENE)))


def _fresh_state(
    collection: Collection, jobs: dict[str, JobOrder], store_address: str
) -> CollectionState:
    """Return this batch's state, with the rows that the last one left for the same scenes."""
    before = read_state(collection.out)
    if before is not None and before.name != collection.name:
        raise WrongUse(
            f"{collection.out} holds the collection {before.name}: give another --out for"
            f" {collection.name}"
        )
    unreadable = {scene.name: scene.reason for scene in collection.unreadable}
    rows = {}
    for name in sorted([*jobs, *unreadable]):
        rows[name] = before.rows.get(name, SceneRow(name)) if before else SceneRow(name)
        if name in unreadable:
            rows[name] = SceneRow(name, "failed", [unreadable[name]])
    return CollectionState(
        name=collection.name,
        source=collection.source,
        store=store_address,
        out=collection.out,
        rows=rows,
        owner=Owner.here(),
        remarks=list(collection.remarks),
        before=dict(before.rows) if before else {},
    )


def chosen_names(
    only: tuple[str, ...], collection: str, names: Iterable[str], out: Path
) -> list[str]:
    """Return which of a collection's scenes ``--only`` means, all if it is empty.

    Raises WrongUse for a name that is none of them.
    """
    known = list(names)
    wanted: set[str] = set() if only else set(known)
    for name in only:
        if name == ONLY_FAILED:
            wanted |= set(failed_names(out))
        elif name in known:
            wanted.add(name)
        else:
            raise WrongUse(f"no scene of {collection} is called {name}: correct --only")
    return [name for name in known if name in wanted]


class _Runner:
    """One batch: a queue of scenes to plan, one of scenes to run, and the workers."""

    def __init__(
        self,
        state: CollectionState,
        jobs: dict[str, JobOrder],
        chosen: list[str],
        options: Options,
        budget: Budget,
        on_event: Callable[[RowEvent], None],
    ) -> None:
        self._state = state
        self._jobs = jobs
        self._chosen = chosen
        self._options = options
        self._budget = budget
        self._on_event = on_event
        self._store = Store.open(state.store)
        self._unplanned = deque(name for name in chosen if name in jobs)
        self._ready: list[tuple[Priority, str]] = []  # a heap
        self._positions = {name: position for position, name in enumerate(chosen)}
        self._passed: dict[str, int] = {}
        self._earlier: dict[str, int] = {}  # steps executed in earlier passes
        self._costs: Callable[[], dict[str, Any]] = dict
        self._workers: list[WorkerProcess] = []
        self._environment = dict(os.environ)

    def run(self) -> CollectionResult:
        """Do everything; the state says how it ended, however it ends."""
        for name in self._chosen:
            if name in self._jobs:
                self._state.rows[name] = self._fresh(name, "waiting")
            else:
                self._tell("finished", self._state.rows[name])
        self._state.save()
        self._state.save_failed()
        try:
            self._plan_until_work()
            if self._ready and not self._must_stop():
                self._in_engine()
            self._state.phase = "stopped" if self._must_stop() else "finished"
        except BaseException:
            self._state.phase = "stopped"
            raise
        finally:
            self._end_workers()
            end_running(self._state, "the batch was stopped; the same command goes on from there")
            self._state.restore_waiting()
            self._save_all()
        rows = tuple(self._state.rows[name] for name in self._chosen)
        return CollectionResult(rows, worst_status(rows))

    def _save_all(self) -> None:
        self._state.save()
        self._state.save_failed()
        write_page(self._state)

    def _in_engine(self) -> None:
        with self._models_kept():
            if self._options.engine == "local":
                self._work()
                return
            from flows.collection.prefect_collection import in_collection_flow

            in_collection_flow(self._state.name, self._work, self._environment)

    @contextmanager
    def _models_kept(self) -> Iterator[None]:
        """Have all scenes ask their models of one keeper, if they ask any on this machine."""
        asks = any(job.models for job in self._jobs.values())
        if not asks or self._options.runner.name is not None:
            yield
            return
        from tasks.model.keeper_process import is_wanted, kept_by, model_keeper

        if not is_wanted():
            yield
            return
        with model_keeper(self._budget) as self._costs:
            self._environment |= kept_by()
            try:
                yield
            finally:
                self._state.models = self._costs()

    def _plan_until_work(self) -> None:
        """Look for finished scenes; no server and no worker is started for these."""
        while self._unplanned and not self._ready and not self._must_stop():
            self._plan_next()

    def _work(self) -> None:
        while self._unplanned or self._ready or self._busy:
            if self._must_stop():
                return
            if self._unplanned:
                self._plan_next()
            self._fill()
            self._listen(0.0 if self._unplanned else _POLL_S)
            self._state.save(now=False)

    def _must_stop(self) -> bool:
        if self._options.keep_going:
            return False
        return any(self._state.rows[name].status == "failed" for name in self._chosen)

    # -- planning -------------------------------------------------------------------------

    def _plan_next(self) -> None:
        row = self._state.rows[self._unplanned.popleft()]
        try:
            report = self._jobs[row.name].make().plan(self._store)
        except Exception as error:  # noqa: BLE001 - whatever it is, it is this scene's alone
            report = {"status": "failed", "reasons": [failure_reason(error)]}
        if report is None:
            self._put_ready(row.name)
            self._tell("planned", row)
            return
        row.take(report)
        row.running = []
        self._tell("finished", row)

    # -- working --------------------------------------------------------------------------

    @property
    def _busy(self) -> bool:
        return any(worker.job is not None for worker in self._workers)

    def _fill(self) -> None:
        """Give every free worker a scene; start workers as far as there are scenes."""
        for worker in [w for w in self._workers if w.job is None]:
            if self._ready:
                self._start(self._next_ready(), worker)
        while self._ready and len(self._workers) < self._state.scenes_at_once:
            setting = WorkerSetting(
                store=self._state.store,
                engine=self._options.engine,
                budget=self._budget.to_json(),
                runner=self._options.runner.name,
                shared_store=self._options.runner.shared_store,
                collection=self._state.name,
                path=sys.path,
            )
            worker = WorkerProcess(setting, self._environment)
            self._workers.append(worker)
            self._start(self._next_ready(), worker)

    def _next_ready(self) -> str:
        """Take the scene whose turn it is out of the queue."""
        return heapq.heappop(self._ready)[1]

    def _put_ready(self, name: str) -> None:
        passed, stops = self._passed.get(name, 0), self._jobs[name].stops
        heapq.heappush(self._ready, (priority(self._positions[name], passed, stops), name))

    def _start(self, name: str, worker: WorkerProcess) -> None:
        job, passed = self._jobs[name], self._passed.get(name, 0)
        worker.give(dataclasses.replace(job, postponed=postponed(job.stops, passed)))
        if passed == 0:
            self._state.rows[name] = self._fresh(name, "running")
        row = self._state.rows[name]
        row.status, row.started = "running", worker.started
        self._tell("started", row)

    def _fresh(self, name: str, status: Status) -> SceneRow:
        """Return a scene's row without what was known, but for the package that is there."""
        before = self._state.before.get(name)
        return SceneRow(name, status, package=before.package if before else None)

    def _listen(self, seconds: float) -> None:
        by_pipe = {worker.answers: worker for worker in self._workers}
        ready, _, _ = select.select(list(by_pipe), [], [], seconds)
        for pipe in ready:
            worker = by_pipe[pipe]
            messages = worker.hear()
            if messages is None:
                self._bury(worker)
                continue
            for message in messages:
                self._take(worker, message)

    def _take(self, worker: WorkerProcess, message: dict[str, Any]) -> None:
        row = self._state.rows[worker.job or ""]
        if "event" in message:
            follow(row, message["event"])
            self._tell("progress", row)
            return
        worker.finish_job()
        failed = {"status": "failed", "reasons": [message.get("failed")]}
        report = message.get("done", failed)
        if "postponed" in report:
            self._put_back(row, report, worker)
        else:
            self._finish(row, report, worker)
        if worker.is_worn:
            self._workers.remove(worker)
            worker.end(GRACE_S)

    def _bury(self, worker: WorkerProcess) -> None:
        """Take a worker out that died: the scene that it worked on has failed."""
        self._workers.remove(worker)
        if worker.job is not None:
            report = {"status": "failed", "reasons": [worker.how_it_died()]}
            self._finish(self._state.rows[worker.job], report, worker)
        worker.end()

    def _put_back(self, row: SceneRow, report: dict[str, Any], worker: WorkerProcess) -> None:
        """Queue a scene for its next pass."""
        self._passed[row.name] = passes_made(self._jobs[row.name].stops, report)
        self._earlier[row.name] = row.executed
        row.seconds = round(row.seconds + time.time() - worker.started, 3)
        row.status, row.running = "waiting", []
        self._put_ready(row.name)
        self._tell("progress", row)

    def _finish(self, row: SceneRow, report: dict[str, Any], worker: WorkerProcess) -> None:
        earlier = self._earlier.pop(row.name, 0)
        row.take(report)
        if "executed" in report and earlier:
            row.executed, row.cached = row.executed + earlier, max(row.cached - earlier, 0)
        row.running = []
        row.finished = time.time()
        row.seconds = round(row.seconds + row.finished - worker.started, 3)
        self._state.models = self._costs()
        if row.status == "failed":
            self._state.save_failed()
        self._tell("finished", row)

    def _end_workers(self) -> None:
        for worker in self._workers:
            if worker.job is not None:
                worker.ask_to_end()
        for worker in self._workers:
            worker.end(GRACE_S)
        self._workers = []

    def _tell(
        self, kind: Literal["planned", "started", "progress", "finished"], row: SceneRow
    ) -> None:
        self._state.save(now=False)
        self._on_event(RowEvent(kind, row))


def follow(row: SceneRow, event: dict[str, Any]) -> None:
    """Take a step's event into its scene's row."""
    step, target = event["step"], event["label"]
    known = next((r for r in row.running if (r.step, r.target) == (step, target)), None)
    if event["kind"] == "finished":
        if known is not None:
            row.running.remove(known)
        row.executed += event["outcome"] == "executed"
        row.cached += event["outcome"] == "cached"
        row.peak_mb = max(row.peak_mb, event["peak_mb"])
        return
    if known is None:
        known = RunningStep(step, target, event["time"])
        row.running.append(known)
    if event["kind"] == "progress":
        known.share, known.doing = round(event["share"] or 0.0, 3), event["doing"]
