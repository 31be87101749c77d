"""Run a collection's jobs, one after the other: ``python -m flows.collection.worker PIPE PARENT``.

The first line on standard input says where everything is (``WorkerSetting``), every further
one is a ``JobOrder``; answers are JSON lines on descriptor ``PIPE``. A worker dies with its
parent, and what its steps started dies with it.
"""

from __future__ import annotations

import dataclasses
import json
import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any

from tasks.parent_process import Answers, die_with


@dataclass(frozen=True)
class WorkerSetting:
    """What all jobs of a worker share; ``collection`` marks their flow runs in Prefect."""

    store: str
    engine: str
    budget: dict[str, Any]
    runner: str | None
    shared_store: bool
    collection: str
    path: list[str]


def main() -> None:
    """Answer every order until standard input ends."""
    descriptor, parent = int(sys.argv[1]), int(sys.argv[2])
    die_with(parent)
    os.set_inheritable(descriptor, False)
    answers = Answers(descriptor)
    setting = WorkerSetting(**json.loads(sys.stdin.readline()))
    sys.path[:] = setting.path
    with ExitStack() as stack:
        work = _Work(setting, answers, stack)
        for line in sys.stdin:
            answers.send(work.obey(json.loads(line)))


class _Work:
    """The store, the budget and the runner, opened once for all jobs."""

    def __init__(self, setting: WorkerSetting, answers: Answers, stack: ExitStack) -> None:
        from flows.step_runner import step_runner
        from storage import Store
        from tasks.step import Budget

        self._setting = setting
        self._answers = answers
        self._store = Store.open(setting.store)
        self._budget = Budget.from_json(setting.budget)
        self._elsewhere = stack.enter_context(
            step_runner(setting.runner, self._store, shared=setting.shared_store)
        )
        if len(self._budget.cores) < (os.cpu_count() or 1):
            self._budget.confine()

    def obey(self, order: dict[str, Any]) -> dict[str, Any]:
        """Do one job and return the answer that ends it."""
        from flows.collection.job import JobOrder, JobRun

        engine: Any = self._setting.engine
        try:
            known = JobOrder(**order)
            job = known.make()
            postponed = frozenset(known.postponed)
            with _tagged(self._setting):
                events = JobRun(self._tell, engine, self._budget, self._elsewhere, postponed)
                report = job.run(self._store, events)
        except Exception as error:  # noqa: BLE001 - whatever it is, it is this scene's alone
            return {"failed": failure_reason(error)}
        return {"done": report}

    def _tell(self, event: Any) -> None:
        answer = {
            name: getattr(event, name)
            for name in ("kind", "step", "label", "time", "share", "doing", "outcome", "peak_mb")
        }
        self._answers.send({"event": answer})


def failure_reason(error: Exception) -> str:
    """Return an error's own sentence if it is one for users, else with its kind."""
    from flows.command import expected_errors

    if isinstance(error, expected_errors()):
        return str(error)
    import traceback

    traceback.print_exception(error)
    return f"{type(error).__name__}: {error}"


@contextmanager
def _tagged(setting: WorkerSetting) -> Iterator[None]:
    if setting.engine != "prefect":
        yield
        return
    from flows.prefect_flow import of_collection

    with of_collection(setting.collection):
        yield


def to_json(setting: WorkerSetting) -> str:
    """Return the first line that a worker reads."""
    return json.dumps(dataclasses.asdict(setting)) + "\n"


if __name__ == "__main__":
    main()
