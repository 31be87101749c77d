"""Take one call from its key to its reference: look up, wait, compute, record, explain."""

from __future__ import annotations

import dataclasses
import errno
import random
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from garden_models.foundation.failure import ModelFailed, ModelOutOfMemory
from garden_models.scene import BadGeometry, BadInput
from storage import ActionRecord, CorruptArtifact, MissingArtifact, Output, StoreError
from storage.redact import redact
from tasks.step.budget import Held, is_holding
from tasks.step.compute import Done, compute
from tasks.step.inputs import Arguments, each
from tasks.step.key import KeyParts, explain
from tasks.step.ref import (
    Cancelled,
    MemoryLimit,
    Outcome,
    PlanAction,
    PlanEntry,
    Postponed,
    Ref,
    Seconds,
    StepCrashed,
    StepEvent,
    StepFailed,
    TimeLimit,
    Why,
    step_name,
)
from tasks.step.run import RunContext

if TYPE_CHECKING:
    from tasks.step import Step

_SPEAKING = (
    BadInput,
    BadGeometry,
    StoreError,
    StepFailed,
    TimeLimit,
    MemoryLimit,
    StepCrashed,
    Cancelled,
    ModelFailed,
    ModelOutOfMemory,
)
HIT = Why("hit", "found in the store")
LONGEST_WAIT_S = 6 * 3600.0
_POLL_S = (0.05, 1.0)
_BACK_OFF_S = 0.5
_TRANSIENT = {
    errno.EIO,
    errno.EAGAIN,
    errno.EINTR,
    errno.EBUSY,
    errno.ESTALE,
    errno.EMFILE,
    errno.ENFILE,
    errno.ENOMEM,
    errno.ETIMEDOUT,
    errno.ECONNRESET,
    errno.ECONNREFUSED,
    errno.EPIPE,
}


@dataclass(frozen=True)
class Call:
    """One call of a step in a run."""

    context: RunContext
    step: Step
    arguments: Arguments
    label: str

    @property
    def name(self) -> str:
        """The step with its target."""
        return step_name(self.step.name, self.label)


def plan(call: Call) -> Ref:
    """Say what a run would do, and do nothing."""
    context = call.context
    if pending := call.arguments.pending:
        upstream = sorted(
            {ref.step for name in pending for ref in each(call.arguments.refs[name]) if ref.pending}
        )
        why = Why("upstream", f"{' and '.join(upstream)} would run first")
        return _planned(call, None, why, key="")
    parts = call.step.key_parts(call.arguments)
    forced = context.is_forced(call.step.name, call.name)
    record, reason = context.store.lookup(parts.key, mend=False)
    if record is not None and not forced:
        return _planned(call, record, HIT, key=parts.key)
    return _planned(call, None, _why(call, parts, reason, forced), key=parts.key)


def _planned(call: Call, record: ActionRecord | None, why: Why, key: str) -> Ref:
    if record is None:
        ref = Ref(
            call.step.returns, "", "", key, call.step.name, call.label, outcome="pending", why=why
        )
    else:
        ref = _ref(call, record, "cached", why)
    action: PlanAction = "would run" if record is None else "cached"
    call.context.add_plan(PlanEntry(call.step.name, call.label, action, why, ref))
    return ref


def check_postponed(call: Call) -> None:
    """Raise Postponed for a call that has to run and is left to a later run."""
    context, step = call.context, call.step
    if step.name not in context.postponed or context.engine == "plan":
        return
    try:
        parts = step.key_parts(call.arguments)
    except Exception:  # noqa: BLE001 - whatever it is, the run of the step tells it
        return
    if context.is_forced(step.name, call.name) or context.store.lookup(parts.key)[0] is None:
        raise Postponed(step.name, call.label)


def execute(call: Call, lost: str = "") -> Ref:
    """Return the call's result from the store, or make it.

    ``lost`` says how an earlier result went, if the caller knows: corrupt or evicted.

    Raises:
        StepFailed: there is none, and why.
    """
    context, step = call.context, call.step
    started = time.monotonic()
    why = None
    try:
        _stop_if_cancelled(context)
        parts = step.key_parts(call.arguments)
        forced = context.is_forced(step.name, call.name)
        record, reason = (None, "absent") if forced else context.store.lookup(parts.key)
        if record is not None:
            return _hit(call, record, Seconds())
        why = _why(call, parts, lost or reason, forced)
        if context.elsewhere is not None and not step.spec.here:
            ref = context.elsewhere(call)
            _remember_producer(call, ref)
            return ref
        with _single_flight(call, parts.key, forced) as found:
            waited = time.monotonic() - started
            if found is not None:
                return _hit(call, found, Seconds(wait=waited))
            with _room(call) as held:
                return _make(call, parts, why, waited + held.waited, held.gpus)
    except Exception as error:
        failure = _failure(call, error)
        seconds = Seconds(compute=time.monotonic() - started)
        _finished(call, "failed", seconds, why=why, error=failure.reason)
        if failure.reason != _reason(error):  # a secret in it must not get out as the cause
            raise failure from None
        raise failure from error


def _hit(call: Call, record: ActionRecord, seconds: Seconds) -> Ref:
    call.context.store.remember_latest(record, call.context.scene, call.label)
    ref = _ref(call, record, "cached", HIT)
    _remember_producer(call, ref)
    _finished(call, "cached", seconds, ref=ref)
    return ref


def _room(call: Call) -> AbstractContextManager[Held]:
    """Hold the step's part of the run's budget while it is computed."""
    context = call.context
    if context.budget is None:
        return nullcontext(Held())
    return context.budget.hold(call.step.spec.need, context.cancelled)


def _make(call: Call, parts: KeyParts, why: Why, waited: float, gpus: tuple[str, ...]) -> Ref:
    context, step = call.context, call.step
    context.protect()
    context.store.make_room()
    context.emit(_event(call, "started", why=why))
    started = time.time()
    done, attempt = _with_retries(call, gpus)
    waited += done.seconds.wait
    published = done.published
    recording = time.monotonic()
    record = ActionRecord(
        key=parts.key,
        step=step.name,
        scene=context.scene,
        label=call.label,
        outputs={
            "value": Output(published.object, published.content, published.kind, published.bytes)
        },
        verdict={"status": done.verdict.status, "reasons": list(done.verdict.reasons)},
        seconds=dataclasses.asdict(dataclasses.replace(done.seconds, wait=waited)),
        peak_mb=round(done.peak_mb, 1),
        started=started,
        parts=parts.to_json(),
        backend=parts.backend,
        host=socket.gethostname(),
        run_id=context.run_id,
        attempt=attempt,
        why=dataclasses.asdict(why),
    )
    counted = context.store.record(record)
    context.store.remember_latest(counted, context.scene, call.label)
    publish = done.seconds.publish + time.monotonic() - recording
    seconds = dataclasses.replace(done.seconds, publish=publish, wait=waited)
    ref = _ref(call, counted, "executed", why)
    if not counted.same_outputs(record):
        note = "made again and came out different; the first result counts"
        ref = dataclasses.replace(ref, reasons=(*ref.reasons, note))
    _remember_producer(call, ref)
    _finished(call, "executed", seconds, ref=ref, peak_mb=done.peak_mb)
    return ref


def _with_retries(call: Call, gpus: tuple[str, ...]) -> tuple[Done, int]:
    """Compute; try again after faults that may pass."""
    attempt = 1
    while True:
        try:
            return _compute(call, gpus), attempt
        except (OSError, MemoryError) as error:
            if not is_transient(error) or attempt > call.step.spec.retries:
                raise
        pause = _BACK_OFF_S * 2 ** (attempt - 1) * random.uniform(0.5, 1.5)
        call.context.cancelled.wait(pause)
        _stop_if_cancelled(call.context)
        attempt += 1


def _compute(call: Call, gpus: tuple[str, ...]) -> Done:
    def report(share: float, doing: str) -> None:
        call.context.emit(_event(call, "progress", share=share, doing=doing))

    if call.step.spec.isolated and call.context.isolate:
        return _compute_isolated(call, report, gpus)
    return compute(call.context, call.step, call.arguments, report)


def _compute_isolated(
    call: Call, report: Callable[[float, str], None], gpus: tuple[str, ...]
) -> Done:
    """Compute in a child process, once more if it found an input that was damaged or gone."""
    from tasks.step.isolate import compute_isolated
    from tasks.step.lost_inputs import make_again

    order = call.context, call.step, call.arguments, call.label
    try:
        return compute_isolated(*order, report, gpus)
    except (CorruptArtifact, MissingArtifact):
        if not make_again(call.context, call.arguments):
            raise
    return compute_isolated(*order, report, gpus)


def is_transient(error: BaseException) -> bool:
    """Tell whether the same call may well succeed a moment later."""
    if isinstance(error, MemoryError | ConnectionError | TimeoutError):
        return True
    return isinstance(error, OSError) and error.errno in _TRANSIENT


def _stop_if_cancelled(context: RunContext) -> None:
    if context.cancelled.is_set():
        raise Cancelled("the run was stopped")


def _failure(call: Call, error: Exception) -> StepFailed:
    """Return a step's error as the user shall read it; its own sentence if it has one."""
    if isinstance(error, StepFailed) and error.step == call.step.name:
        return error
    return StepFailed(
        call.step.name,
        call.label,
        redact(_reason(error)),
        kind=type(error).__name__,
        retryable=is_transient(error),
    )


def _reason(error: Exception) -> str:
    if isinstance(error, StepFailed):
        return error.reason
    if isinstance(error, _SPEAKING):
        return str(error)
    if isinstance(error, MemoryError):
        return "out of memory: close other programs or choose a smaller image size"
    return f"{type(error).__name__}: {error}"


@contextmanager
def _single_flight(call: Call, key: str, forced: bool) -> Iterator[ActionRecord | None]:
    """Become the one that computes ``key`` (gives None), or give what another one found.

    Whoever holds the lease dies with it; whoever waits takes over. After a bounded wait
    the step is computed anyway: the first result counts. That is at once for what holds a
    part of the budget, for which the other one may be waiting.
    """
    store = call.context.store
    deadline = time.monotonic() + (0.0 if is_holding() else LONGEST_WAIT_S)
    pause = _POLL_S[0]
    while (lease := store.acquire(key)) is None and time.monotonic() < deadline:
        call.context.cancelled.wait(pause)
        _stop_if_cancelled(call.context)
        pause = min(2 * pause, _POLL_S[1])
        if not forced:
            record, _reason = store.lookup(key)
            if record is not None:
                yield record
                return
    try:
        yield None if forced else store.lookup(key)[0]
    finally:
        if lease is not None:
            store.leases.release(lease)


def _why(call: Call, parts: KeyParts, reason: str, forced: bool) -> Why:
    if forced:
        return Why("forced", "asked for by the user")
    if reason == "corrupt":
        return Why("corrupt", "its stored result was damaged")
    if reason == "evicted":
        return Why("evicted", "its result is no longer in the store")
    store, place = call.context.store, (call.context.scene, call.step.name, call.label)
    last = store.latest(*place)
    if last is None and store.has_run(*place):
        return Why("evicted", "its earlier result is no longer in the store")
    return explain(parts, None if last is None else last.parts)


def _remember_producer(call: Call, ref: Ref) -> None:
    """Keep how to make a result again, should it turn out to be damaged when read."""
    call.context.producers[ref.object] = lambda lost: execute(call, lost)


def _ref(call: Call, record: ActionRecord, outcome: Outcome, why: Why) -> Ref:
    output = record.outputs["value"]
    return Ref(
        kind=output.kind,
        content=output.content,
        object=output.object,
        key=record.key,
        step=call.step.name,
        label=call.label,
        status=record.verdict["status"],
        reasons=tuple(record.verdict["reasons"]),
        outcome=outcome,
        backend=record.backend,
        why=why,
        seconds=Seconds(**record.seconds),
        peak_mb=record.peak_mb,
        bytes=output.bytes,
    )


def _event(call: Call, kind: Any, **values: Any) -> StepEvent:
    return StepEvent(kind, call.step.name, call.label, call.context.scene, time.time(), **values)


def _finished(
    call: Call,
    outcome: Any,
    seconds: Seconds,
    *,
    ref: Ref | None = None,
    why: Why | None = None,
    peak_mb: float = 0.0,
    error: str = "",
) -> None:
    call.context.emit(
        _event(
            call,
            "finished",
            outcome=outcome,
            backend=ref.backend if ref else "",
            seconds=seconds,
            peak_mb=peak_mb,
            status=ref.status if ref else "failed",
            reasons=ref.reasons if ref else (error,),
            why=ref.why if ref else why,
            ref=ref,
            error=error,
        )
    )
