"""Have the steps of a run computed by Dask workers on other machines.

The run itself stays here: it looks results up, follows the steps and draws them. What is not
in the store is sent to a worker as a JSON order; the worker answers with a reference. A worker
needs the same code and the store, and nothing else: no Prefect server, no file of the user's.
"""

from __future__ import annotations

import json
import queue
import threading
import time
import uuid
from dataclasses import dataclass, field
from types import TracebackType
from typing import Any, Self

from storage.address import is_remote
from storage.redact import redact
from tasks.step import dask_worker
from tasks.step.execute import Call
from tasks.step.lost_inputs import make_again
from tasks.step.order import write_order
from tasks.step.ref import Cancelled, Ref, StepFailed
from tasks.step.run import RunContext
from tasks.step.wire import event_from_json

_CONNECT_S, _FIRST_WORKER_S = 15.0, 30.0
_WORKERLESS_S = 600.0
_POLL_S, _LOOK_EVERY_S = 0.2, 15.0
_SAME_CODE = "; the scheduler and its workers need the same garden as this machine"
_LOST_INPUT = ("CorruptArtifact", "MissingArtifact")


class RunnerError(RuntimeError):
    """The runner cannot be used; the message says what to do."""


@dataclass
class DaskRunner:
    """Computes calls on the workers of a Dask scheduler; use it as a context manager.

    Args:
        address: the scheduler's, ``tcp://HOST:PORT`` or ``tls://HOST:PORT``.
        store: the store's address, as workers open it.
        shared: a store in a folder is the same folder on every worker's machine.
    """

    address: str
    store: str
    shared: bool = False
    _client: Any = None
    _topic: str = field(default_factory=lambda: f"garden-{uuid.uuid4().hex}")
    _waiting: dict[tuple[str, str, str], RunContext] = field(default_factory=dict)
    _events: queue.SimpleQueue[Any] = field(default_factory=queue.SimpleQueue)
    _stopped: set[str] = field(default_factory=set)
    _guard: threading.Lock = field(default_factory=threading.Lock)

    def __enter__(self) -> Self:
        """Connect.

        Raises:
            RunnerError: no scheduler or no worker answers, or a worker cannot see the store.
        """
        self._client = _connect(self.address)
        try:
            self._check_workers()
            threading.Thread(target=self._pass_on, name="dask-events", daemon=True).start()
            self._client.subscribe_topic(self._topic, self._events.put)
        except BaseException:
            self._client.close()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Disconnect; what is still queued is dropped, what is running is finished and kept."""
        self._events.put(None)
        self._client.close()

    def __call__(self, call: Call) -> Ref:
        """Have a call that is not in the store computed; return its reference.

        Raises:
            StepFailed: as the step failed there, or what became of its worker.
            Cancelled: the run was stopped.
        """
        try:
            return self._compute(call)
        except StepFailed as failure:
            if failure.kind not in _LOST_INPUT or not make_again(call.context, call.arguments):
                raise
        return self._compute(call)

    def _compute(self, call: Call) -> Ref:
        waiting = (call.context.run_id, call.step.name, call.label)
        with self._guard:
            self._waiting[waiting] = call.context
        try:
            answer = self._ask(call)
        finally:
            with self._guard:
                self._waiting.pop(waiting, None)
        if "failed" in answer:
            raise StepFailed(**answer["failed"])
        call.context.emit(event_from_json(answer["finished"]))
        return Ref.from_json(answer["ref"])

    def _ask(self, call: Call) -> dict[str, Any]:
        name = call.name
        future = self._client.submit(
            dask_worker.obey,
            json.dumps(self._order(call)),
            key=f"{call.step.name}-{uuid.uuid4().hex}",
            pure=False,
        )
        done = threading.Event()
        future.add_done_callback(lambda _future: done.set())
        deadline = _Deadline(self._client)
        try:
            while not done.wait(_POLL_S):
                if call.context.cancelled.is_set():
                    self._stop(call.context.run_id)
                    raise Cancelled("the run was stopped")
                if deadline.passed():
                    raise _failed(
                        call, "NoWorker", f"no Dask worker came back in {_WORKERLESS_S:g} s"
                    )
            answer: dict[str, Any] = json.loads(future.result())
            return answer
        except (StepFailed, Cancelled):
            future.cancel()
            raise
        except Exception as error:  # noqa: BLE001 - Dask raises errors of many kinds
            kind = type(error).__name__
            hint = _SAME_CODE if "deserialization" in str(error) else ""
            reason = f"no Dask worker finished {name}: {kind}: {error}{hint}"
            raise _failed(call, kind, redact(reason)) from None

    def _order(self, call: Call) -> dict[str, Any]:
        context = call.context
        order = write_order(context, call.step, call.arguments, call.label)
        return order | {
            "step": call.step.name,
            "forced": context.is_forced(call.step.name, call.name),
            "topic": self._topic,
            "machine": "" if self._anywhere else dask_worker.machine(),
        }

    @property
    def _anywhere(self) -> bool:
        return self.shared or is_remote(self.store)

    def _check_workers(self) -> None:
        from distributed import TimeoutError as NoWorker

        try:
            self._client.wait_for_workers(1, timeout=_FIRST_WORKER_S)
            machines = self._client.run(dask_worker.machine)
        except NoWorker:
            raise RunnerError(
                f"the Dask scheduler {self.address} has no workers: start some with"
                f" `dask worker {self.address}`"
            ) from None
        except Exception as error:
            raise RunnerError(
                f"the Dask workers of {self.address} cannot run garden: install the same version"
                f" there, or set PYTHONPATH ({type(error).__name__}: {error})"
            ) from error
        strange = sorted({name for name in machines.values() if name != dask_worker.machine()})
        if strange and not self._anywhere:
            raise RunnerError(
                f"the store {self.store} is a folder of this machine, and workers run on"
                f" {strange[0].split()[0]}: use a store in a bucket (--store s3://BUCKET/PREFIX),"
                " or say with --shared-store that the folder is the same on all machines"
            )

    def _stop(self, run_id: str) -> None:
        """Tell all workers, once, that a run was stopped."""
        with self._guard:
            if run_id in self._stopped:
                return
            self._stopped.add(run_id)
        self._client.run(dask_worker.stop, run_id, on_error="ignore")

    def _pass_on(self) -> None:
        """Give the workers' events to their runs, outside of Dask's own thread."""
        while (item := self._events.get()) is not None:
            _time, message = item
            event = event_from_json(json.loads(message["event"]))
            with self._guard:
                context = self._waiting.get((message["run_id"], event.step, event.label))
            if context is not None:
                context.emit(event)


def _connect(address: str) -> Any:
    from distributed import Client

    try:
        return Client(address, timeout=_CONNECT_S, set_as_default=False, name="garden")
    except (OSError, ValueError) as error:
        raise RunnerError(
            f"no Dask scheduler answers at {address}: start one with `dask scheduler --host"
            f" 127.0.0.1`, or correct the address ({type(error).__name__})"
        ) from error


class _Deadline:
    """Passes when a scheduler has had no worker for too long."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._look_at = time.monotonic() + _LOOK_EVERY_S
        self._seen_at = time.monotonic()

    def passed(self) -> bool:
        now = time.monotonic()
        if now < self._look_at:
            return False
        self._look_at = now + _LOOK_EVERY_S
        if self._client.nthreads():
            self._seen_at = now
        return now - self._seen_at > _WORKERLESS_S


def _failed(call: Call, kind: str, reason: str) -> StepFailed:
    return StepFailed(call.step.name, call.label, reason, kind=kind, retryable=True)
