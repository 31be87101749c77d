"""Carry what all steps of one run share: the store, the scene, the engine, the listeners."""

from __future__ import annotations

import contextlib
import contextvars
import signal
import threading
import uuid
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any, Literal, TypeVar

from storage import Store, StoreError
from tasks.step.budget import Budget
from tasks.step.ref import PendingValue, PlanEntry, Ref, StepEvent
from tasks.step.start_child import SpareChild

Engine = Literal["prefect", "local", "plan"]
T = TypeVar("T")

PROTECTED_S = 24 * 3600.0  # by then its oldest results are held by their age no more


def ignore_event(event: StepEvent) -> None:
    """Tell nobody."""


@dataclass
class RunContext:
    """One run over one scene.

    ``force`` names steps (``segment`` or ``segment[bulldozer]``, ``*`` for all) that run
    even on a hit. ``workers`` bounds the steps that the local engine runs at once.
    ``isolate=False`` runs isolated steps in this process (for tests). Without ``budget``
    steps wait for nobody. ``elsewhere`` computes calls that are not in the store on other
    machines (``tasks.step.dask_runner``). ``postponed`` names steps that are not run here: a call
    that is not in the store raises Postponed. ``spare`` has a child ready for the next isolated
    step. ``outcomes`` and ``plan`` are filled as steps finish.
    """

    store: Store
    scene: str
    engine: Engine = "local"
    events: Callable[[StepEvent], None] = ignore_event
    force: frozenset[str] = frozenset()
    workers: int = 2
    isolate: bool = True
    budget: Budget | None = None
    run_id: str = field(default_factory=lambda: uuid.uuid4().hex[:12])
    outcomes: list[StepEvent] = field(default_factory=list)
    plan: list[PlanEntry] = field(default_factory=list)
    cancelled: threading.Event = field(default_factory=threading.Event)
    elsewhere: Callable[[Any], Ref] | None = None
    postponed: frozenset[str] = frozenset()
    spare: SpareChild | None = None
    producers: dict[str, Callable[[str], Ref]] = field(default_factory=dict)
    _guard: threading.RLock = field(default_factory=threading.RLock)
    _pin: str = ""

    def emit(self, event: StepEvent) -> None:
        """Pass an event on, one at a time."""
        with self._guard:
            if event.kind == "finished":
                self.outcomes.append(event)
            self.events(event)

    def add_plan(self, entry: PlanEntry) -> None:
        """Note what a run would do with a step."""
        with self._guard:
            self.plan.append(entry)

    def protect(self) -> None:
        """Hold the scene's results against collection while the run, or its process, lives.

        A store that takes no pin is one from which this machine's collectors take nothing.
        """
        with self._guard:
            if self._pin:
                return
            self._pin = f"run-{self.run_id}"
        with contextlib.suppress(StoreError, OSError):
            self.store.pin(
                self._pin, scenes=[self.scene], reason="a run in progress", for_s=PROTECTED_S
            )

    def unprotect(self) -> None:
        """Let go of what ``protect`` held."""
        with self._guard:
            pin, self._pin = self._pin, ""
        with contextlib.suppress(StoreError, OSError):
            if pin:
                self.store.unpin(pin)

    def is_forced(self, step: str, name: str) -> bool:
        """Tell whether the user asked for this step to run again."""
        return bool(self.force & {"*", step, name})


_current: contextvars.ContextVar[RunContext] = contextvars.ContextVar("garden_run")
_scratch: contextvars.ContextVar[Store] = contextvars.ContextVar("garden_scratch")


def current_run() -> RunContext:
    """Return the run that this code is part of; LookupError outside of one."""
    try:
        return _current.get()
    except LookupError:
        raise LookupError(
            "a step was called outside of a run: use `with run_context(RunContext(...)):`,"
            " or call its pure function as `step.fn(...)`"
        ) from None


def is_stopped() -> bool:
    """Tell whether the run that this code is part of was stopped; False outside of one."""
    context = _current.get(None)
    return context is not None and context.cancelled.is_set()


@contextmanager
def run_context(context: RunContext) -> Iterator[RunContext]:
    """Make ``context`` the run of all steps called inside.

    In the main thread Ctrl-C and SIGTERM also stop isolated children and waiting steps.
    """
    token = _current.set(context)
    try:
        with _stopping(context):
            yield context
    except BaseException:
        context.cancelled.set()
        raise
    finally:
        _current.reset(token)
        context.unprotect()


@contextmanager
def _stopping(context: RunContext) -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    with contextlib.ExitStack() as stack:
        for number in (signal.SIGINT, signal.SIGTERM):
            previous = signal.getsignal(number)
            if previous == signal.SIG_IGN:
                continue  # a shell's background job: Ctrl-C is meant for others
            stack.callback(signal.signal, number, previous)
            signal.signal(number, _stopper(context, previous))
        yield


def _stopper(context: RunContext, previous: Any) -> Callable[[int, FrameType | None], None]:
    def stop(number: int, frame: FrameType | None) -> None:
        context.cancelled.set()
        if callable(previous):
            previous(number, frame)
        elif previous == signal.SIG_DFL:
            raise SystemExit(128 + number)

    return stop


def load(ref: Ref | Future[Ref], expected: type[T], fields: tuple[str, ...] = ()) -> Any:
    """Return the value behind a reference, or a dict of some of its fields, verified.

    Raises:
        PendingValue: a plan has no values of steps that would run first.
        CorruptArtifact: it was damaged, and what made it is not part of this run.
    """
    from tasks.step.inputs import load_ref

    known = ref if isinstance(ref, Ref) else ref.result()
    if known.pending:
        raise PendingValue(f"{known.kind} of {known.step} is not known before it has run")
    return load_ref(current_run(), known, expected, fields)


@contextmanager
def step_scratch() -> Iterator[Path]:
    """Give a folder for libraries that need files; it is removed at the end.

    It lies on the store's disk during a run, else in the system's temporary folder.
    """
    context = _current.get(None)
    if context is not None:
        with context.store.scratch() as folder:
            yield folder
        return
    import tempfile

    with tempfile.TemporaryDirectory(prefix="garden-") as name:
        yield Path(name)
