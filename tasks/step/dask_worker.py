"""Obey orders in a Dask worker: the same look-up, lease, computation and publication.

A worker shares nothing with the run but the store. What it is sent, and answers, is JSON.
"""

from __future__ import annotations

import json
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from storage import StoreError
from storage.redact import redact
from tasks.step.budget import Budget
from tasks.step.execute import Call, execute
from tasks.step.order import CodeDiffers, Order, open_store, read_order
from tasks.step.ref import StepEvent, StepFailed
from tasks.step.run import RunContext, run_context
from tasks.step.wire import event_to_json

_stopping: dict[str, threading.Event] = {}
_busy: dict[str, int] = {}
_guard = threading.Lock()


def machine() -> str:
    """Name the running system of this machine; its processes see the same files."""
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text().strip()
    except OSError:
        boot = ""
    return f"{socket.gethostname()} {boot}"


def stop(run_id: str) -> None:
    """Have the steps of a run that are computed here stop."""
    with _guard:
        if run_id in _stopping:
            _stopping[run_id].set()


def obey(text: str) -> str:
    """Do what an order says; return ``ref`` and ``finished``, or ``failed``, as JSON."""
    order = json.loads(text)
    try:
        answer = _obey(order)
    except Exception as error:  # noqa: BLE001 - the run, not Dask, says what went wrong
        answer = {"failed": _described(order, error)}
    return json.dumps(answer)


def _obey(order: Order) -> dict[str, Any]:
    if order["machine"] not in ("", machine()):
        raise StoreError(
            f"the worker {socket.gethostname()} is another machine and may not see the folder"
            f" {order['store']}: use a store in a bucket, or say that the folder is shared"
        )
    step, arguments = read_order(order)
    last: list[StepEvent] = []
    forward = _forwarder(order)

    def told(event: StepEvent) -> None:
        if event.kind == "finished":
            last.append(event)
        else:
            forward(event)

    with _stoppable(order["run_id"]) as stopping:
        context = RunContext(
            open_store(order),
            order["scene"],
            events=told,
            force=frozenset({"*"} if order["forced"] else ()),
            run_id=order["run_id"],
            cancelled=stopping,
            budget=Budget.of_machine(),
        )
        with run_context(context):
            ref = execute(Call(context, step, arguments, order["label"]))
    return {"ref": ref.to_json(), "finished": event_to_json(last[-1])}


def _forwarder(order: Order) -> Callable[[StepEvent], None]:
    """Return what sends events to the run, over Dask's scheduler."""
    from distributed import get_worker

    worker = get_worker()

    def forward(event: StepEvent) -> None:
        worker.log_event(
            order["topic"], {"run_id": order["run_id"], "event": json.dumps(event_to_json(event))}
        )

    return forward


@contextmanager
def _stoppable(run_id: str) -> Iterator[threading.Event]:
    with _guard:
        stopping = _stopping.setdefault(run_id, threading.Event())
        _busy[run_id] = _busy.get(run_id, 0) + 1
    try:
        yield stopping
    finally:
        with _guard:
            _busy[run_id] -= 1
            if _busy[run_id] == 0:
                del _busy[run_id], _stopping[run_id]


def _described(order: Order, error: Exception) -> dict[str, Any]:
    if isinstance(error, StepFailed):
        failure = error
    else:
        kind = type(error).__name__
        reason = str(error) if isinstance(error, StoreError) else f"{kind}: {error}"
        if isinstance(error, CodeDiffers | ImportError | AttributeError):
            reason = (
                f"the worker {socket.gethostname()} has other code than this run: install the"
                f" same version there ({kind}: {error})"
            )
        failure = StepFailed(order["step"], order["label"], redact(reason), kind=kind)
    return {
        "step": failure.step,
        "label": failure.label,
        "reason": failure.reason,
        "kind": failure.kind,
        "retryable": failure.retryable,
    }
