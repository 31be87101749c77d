"""Run steps at the same time: each starts when its inputs are there, in the same run."""

from __future__ import annotations

import contextvars
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

from tasks.step.execute import Call, execute, plan
from tasks.step.ref import Ref, StepFailed
from tasks.step.run import RunContext, current_run

T = TypeVar("T")
R = TypeVar("R")


def launch_when_ready(
    context: RunContext, inputs: list[Future[Ref]], prepare: Callable[[], Call]
) -> Future[Ref]:
    """Return the future of a call that is made when all ``inputs`` are done.

    A call that waits for its inputs occupies no worker. If an input failed, so does the
    call, with the same error.
    """
    outcome: Future[Ref] = Future()
    inside = contextvars.copy_context()

    def launch() -> None:
        try:
            call = prepare()
            if context.engine == "plan":
                outcome.set_result(plan(call))
            elif context.engine == "prefect":
                from tasks.step.prefect import submit_task

                submit_task(call, outcome)
            else:
                _submit_local(context, call, outcome)
        except Exception as error:  # noqa: BLE001 - the future carries it to who waits
            outcome.set_exception(error)

    _after(inputs, lambda: inside.run(launch))
    return outcome


def _after(inputs: list[Future[Ref]], go: Callable[[], None]) -> None:
    waiting = len(inputs)
    if waiting == 0:
        go()
        return
    guard = threading.Lock()

    def one_done(_future: Future[Ref]) -> None:
        nonlocal waiting
        with guard:
            waiting -= 1
            last = waiting == 0
        if last:
            go()

    for future in inputs:
        future.add_done_callback(one_done)


def _submit_local(context: RunContext, call: Call, outcome: Future[Ref]) -> None:
    inside = contextvars.copy_context()
    running = _pool(context).submit(inside.run, execute, call)
    running.add_done_callback(lambda future: hand_over(future, outcome))


def hand_over(future: Future[Ref], outcome: Future[Ref]) -> None:
    """Give the result, or error, of one future to another."""
    error = future.exception()
    if error is not None:
        outcome.set_exception(error)
    else:
        outcome.set_result(future.result())


_pools: dict[int, ThreadPoolExecutor] = {}
_pools_guard = threading.Lock()


def _pool(context: RunContext) -> ThreadPoolExecutor:
    """Return the pool for this number of workers; pools live as long as the process."""
    with _pools_guard:
        if context.workers not in _pools:
            _pools[context.workers] = ThreadPoolExecutor(context.workers, "step")
        return _pools[context.workers]


def fan_out(function: Callable[[T], R], items: Iterable[T]) -> list[R | StepFailed]:
    """Call ``function`` for every item, in threads of the same run; keep the order.

    A ``StepFailed`` takes the place of its item's result, so that one target that fails
    stops no other; any other error is raised.
    """
    context = current_run()
    chosen = list(items)
    if context.engine == "plan" or len(chosen) < 2:
        return [_guarded(function, item) for item in chosen]
    with ThreadPoolExecutor(min(len(chosen), max(context.workers, 1)), "target") as pool:
        running = [
            pool.submit(contextvars.copy_context().run, _guarded, function, item) for item in chosen
        ]
        return [future.result() for future in running]


def _guarded(function: Callable[[T], R], item: T) -> R | StepFailed:
    try:
        return function(item)
    except StepFailed as failure:
        return failure
