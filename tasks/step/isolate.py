"""Compute a step in a child process that can be stopped, whatever it is doing.

The child loads its inputs from the store and publishes its result itself; only JSON goes
between the two. It is killed with all its children when it runs too long, takes too much
memory, or the run is stopped, and it dies with its parent.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from garden_models import scene
from garden_models.foundation import failure
from storage import CorruptArtifact, Published, errors
from tasks.step.child_process import ChildProcess
from tasks.step.compute import Done
from tasks.step.inputs import Arguments
from tasks.step.order import write_order
from tasks.step.ref import Cancelled, MemoryLimit, Seconds, StepCrashed, TimeLimit
from tasks.step.run import RunContext
from tasks.step.start_child import start_child

if TYPE_CHECKING:
    from tasks.step import Step

_POLL_S = 0.1
_STORE_ERRORS = {
    "MissingArtifact",
    "SchemaMismatch",
    "StoreDenied",
    "StoreFull",
    "StoreMissing",
    "StoreReadOnly",
    "Unstorable",
}


def compute_isolated(
    context: RunContext,
    step: Step,
    arguments: Arguments,
    label: str,
    report: Callable[[float, str], None],
    gpus: tuple[str, ...] = (),
) -> Done:
    """Compute a step in a child process and return what it published.

    ``gpus`` are those that the step holds: the child sees no others, if there are any.

    Raises:
        TimeLimit, MemoryLimit: it was killed for that.
        StepCrashed: it died by itself, or raised an error of an unknown kind.
        Cancelled: the run was stopped.
        BadInput, BadGeometry, MemoryError, OSError, StoreError, ModelFailed: as raised in
            the child.
    """
    order = write_order(context, step, arguments, label) | {"path": sys.path, "gpus": gpus}
    started = start_child(context.store) if context.spare is None else context.spare.take()
    try:
        child = started.obey(order)
        answer = _listen(context, step, child, report)
    finally:
        started.end()
    if "error" in answer:
        raise _rebuild(answer["error"])
    done = answer["done"]
    return Done(
        Published(**done["published"]),
        scene.Verdict(done["verdict"]["status"], tuple(done["verdict"]["reasons"])),
        Seconds(**done["seconds"]),
        max(child.peak.mb, done["peak_mb"]),
    )


def _listen(
    context: RunContext, step: Step, child: ChildProcess, report: Callable[[float, str], None]
) -> dict[str, Any]:
    """Pass on progress until the child gives its answer; kill it when it must end."""
    while True:
        for message in child.messages(_POLL_S):
            if "progress" in message:
                report(*message["progress"])
            elif "waiting" in message:
                child.waits(message["waiting"])
            else:
                return message
        if child.silent:
            raise StepCrashed(child.how_it_died())
        _check_limits(context, step, child)


def _check_limits(context: RunContext, step: Step, child: ChildProcess) -> None:
    if context.cancelled.is_set():
        raise Cancelled("the run was stopped")
    limit_s, limit_gb = step.spec.time_limit_s, step.spec.memory_limit_gb
    if limit_s is not None and child.busy_s() > limit_s:
        raise TimeLimit(
            f"stopped after {limit_s:g} s, its time limit: use fewer or smaller photos,"
            " or raise the limit"
        )
    child.weigh()
    if limit_gb is not None and child.peak.mb > limit_gb * 1000:
        raise MemoryLimit(
            f"stopped at {child.peak.mb / 1000:.1f} GB, above its memory limit of"
            f" {limit_gb:g} GB: use fewer or smaller photos, or raise the limit"
        )


def _rebuild(error: dict[str, Any]) -> Exception:
    """Return the child's error; unknown kinds become StepCrashed with their traceback."""
    kind, message = error["kind"], error["message"]
    if kind in ("BadInput", "BadGeometry"):
        cls: type[Exception] = getattr(scene, kind)
        return cls(message)
    if kind == "CorruptArtifact":
        return CorruptArtifact(error["object"], error["reason"])
    if kind in _STORE_ERRORS:
        store_error: type[Exception] = getattr(errors, kind)
        return store_error(message)
    if kind == "MemoryError":
        return MemoryError(message)
    if kind == "KeeperGone":
        return failure.ModelFailed(message)
    if kind in ("ModelFailed", "ModelOutOfMemory"):
        model_error: type[Exception] = getattr(failure, kind)
        return model_error(message)
    if error.get("errno") is not None:
        return OSError(error["errno"], message)
    crashed = StepCrashed(f"{kind}: {message}")
    crashed.add_note(error["traceback"])
    return crashed
