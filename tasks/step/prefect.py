"""Run steps as Prefect task runs, so that they are seen, named and counted there.

Prefect's own cache and result storage are off: the store decides what is a hit, and a hit
shows as ``Cached``. Values never pass through Prefect, only references.
"""

from __future__ import annotations

import functools
from concurrent.futures import Future
from typing import Any

from tasks.step.execute import Call, execute
from tasks.step.ref import Ref


class Ticket:
    """A call as Prefect sees it: opaque, so that it does not look for futures inside."""

    def __init__(self, call: Call) -> None:
        self.call = call

    def __repr__(self) -> str:
        return self.call.name


def run_task(call: Call) -> Ref:
    """Run a call as a task run in this thread."""
    state = _task(call.step.name)(call.name, Ticket(call), return_state=True)
    result: Ref = state.result()
    return result


def submit_task(call: Call, outcome: Future[Ref]) -> None:
    """Give a call to the flow's task runner; ``outcome`` gets its result."""
    running = _task(call.step.name).submit(call.name, Ticket(call))
    running.add_done_callback(lambda future: _settle(future, outcome))


def _settle(future: Any, outcome: Future[Ref]) -> None:
    try:
        outcome.set_result(future.result())
    except Exception as error:  # noqa: BLE001 - the future carries it to who waits
        outcome.set_exception(error)


@functools.cache
def _task(name: str) -> Any:
    from prefect import task
    from prefect.cache_policies import NO_CACHE

    return task(
        _body,
        name=name,
        task_run_name="{run_name}",
        cache_policy=NO_CACHE,
        persist_result=False,
        retries=0,
    )


def _body(run_name: str, ticket: Ticket) -> Any:
    from prefect.states import Completed

    ref = execute(ticket.call)
    if ref.outcome == "cached":
        return Completed(name="Cached", message=f"hit {ref.content[:15]}", data=ref)
    if ref.status != "ok":
        return Completed(name=ref.status.capitalize(), message="; ".join(ref.reasons), data=ref)
    return ref
