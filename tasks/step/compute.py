"""Do one step: load its inputs, compute, publish; the same in this process and in a child."""

from __future__ import annotations

import dataclasses
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from garden_models.progress import AS_BEFORE, Progress
from garden_models.scene import Verdict
from storage import Published
from storage.redact import redact, redacted
from tasks.step.inputs import Arguments, load_inputs
from tasks.step.memory import peak_memory
from tasks.step.ref import Cancelled, Seconds
from tasks.step.run import RunContext
from tasks.step.seed import seed_everything
from tasks.step.waiting import counted_waits, tell_nobody

if TYPE_CHECKING:
    from tasks.step import Step

_PROGRESS_EVERY_S = 0.1


@dataclass(frozen=True)
class Done:
    """What one execution gave and cost."""

    published: Published
    verdict: Verdict
    seconds: Seconds
    peak_mb: float


def compute(
    context: RunContext,
    step: Step,
    arguments: Arguments,
    report: Callable[[float, str], None],
    tell_waiting: Callable[[bool], None] = tell_nobody,
) -> Done:
    """Run the step's function on the values of its inputs and publish what it returns."""
    with peak_memory() as peak, counted_waits(tell_waiting) as waits:
        started = time.monotonic()
        values = load_inputs(context, arguments, step.hints())
        loaded = time.monotonic()
        extra: dict[str, Any] = {}
        if step.takes_progress:
            extra["progress"] = stoppable(context.cancelled, report)
        seed_everything(step.spec.seed, with_torch="torch" in step.spec.packages)
        result = without_secrets_in_verdict(step.fn(**arguments.plain, **values, **extra))
        computed = time.monotonic()
        del values
        published = context.store.publish(result)
        stored = time.monotonic()
    computing = computed - loaded - waits.seconds
    seconds = Seconds(loaded - started, computing, stored - computed, waits.seconds)
    return Done(published, verdict_of(result), seconds, peak.mb)


def without_secrets_in_verdict(value: Any) -> Any:
    """Return a value whose reasons may be kept: some repeat what a library or server said."""
    verdict = verdict_of(value)
    reasons = redacted(verdict.reasons)
    if reasons == verdict.reasons:
        return value
    return dataclasses.replace(value, verdict=Verdict(verdict.status, reasons))


def verdict_of(value: object) -> Verdict:
    """Return what a value says of itself; ok if it says nothing."""
    verdict = getattr(value, "verdict", None)
    return verdict if isinstance(verdict, Verdict) else Verdict()


def stoppable(cancelled: threading.Event, report: Callable[[float, str], None]) -> Progress:
    """Return a progress function that passes on at most ten calls a second.

    It also is where a step notices that the user stopped the run.
    """
    last = so_far = 0.0

    def progress(share: float, doing: str) -> None:
        nonlocal last, so_far
        if cancelled.is_set():
            raise Cancelled("the run was stopped")
        share = so_far = so_far if share == AS_BEFORE else share
        now = time.monotonic()
        if now - last >= _PROGRESS_EVERY_S or share >= 1.0:
            last = now
            report(share, redact(doing))

    return progress
