"""Say what came of a step: a reference of a few hundred bytes, never the arrays."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any, Literal

from garden_models.scene import Status

Outcome = Literal["executed", "cached", "pending"]
PlanAction = Literal["cached", "would run"]


@dataclass(frozen=True)
class Why:
    """Why a step ran or was skipped (invariant EXPLAINED): a code for machines, a sentence.

    Codes: hit, new, input, config, code, packages, version, backend, weights, seed,
    corrupt, evicted, forced, upstream (an input is not known yet; only in plans).
    """

    code: str
    sentence: str


@dataclass(frozen=True)
class Seconds:
    """Where the wall-clock time of a step went."""

    load: float = 0.0
    compute: float = 0.0
    publish: float = 0.0
    wait: float = 0.0

    @property
    def total(self) -> float:
        """All of it."""
        return self.load + self.compute + self.publish + self.wait


@dataclass(frozen=True)
class Ref:
    """A reference to the result of a step.

    ``content`` is the digest of the value, ``object`` of what is stored, ``key`` of the
    action. ``seconds`` and ``peak_mb`` are those of the run that computed it, also when it
    was found in the store. A pending Ref (only in plans) has no digests.
    """

    kind: str
    content: str
    object: str
    key: str
    step: str
    label: str = ""
    status: Status = "ok"
    reasons: tuple[str, ...] = ()
    outcome: Outcome = "executed"
    backend: str = ""
    why: Why = field(default=Why("new", "nothing is known of it"), compare=False)
    seconds: Seconds = field(default=Seconds(), compare=False)
    peak_mb: float = field(default=0.0, compare=False)
    bytes: int = field(default=0, compare=False)

    @property
    def pending(self) -> bool:
        """Whether the step would have to run first."""
        return self.outcome == "pending"

    @property
    def failed(self) -> bool:
        """Whether the step says that its own result is of no use."""
        return self.status == "failed"

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON."""
        return dataclasses.asdict(self)

    @classmethod
    def from_json(cls, document: dict[str, Any]) -> Ref:
        """Read what ``to_json`` gave."""
        values = dict(document)
        values["reasons"] = tuple(values["reasons"])
        values["why"] = Why(**values["why"])
        values["seconds"] = Seconds(**values["seconds"])
        return cls(**values)


@dataclass(frozen=True)
class StepEvent:
    """What a step is doing, for the terminal, Prefect's page and the report.

    ``time`` is in Unix seconds, ``share`` in 0..1. The fields from ``outcome`` on hold only
    when ``kind`` is ``finished``; ``why`` is known from the start.
    """

    kind: Literal["started", "progress", "finished"]
    step: str
    label: str
    scene: str
    time: float
    share: float | None = None
    doing: str = ""
    outcome: Literal["executed", "cached", "failed"] | None = None
    backend: str = ""
    seconds: Seconds = Seconds()
    peak_mb: float = 0.0
    status: Status = "ok"
    reasons: tuple[str, ...] = ()
    why: Why | None = None
    ref: Ref | None = None
    error: str = ""


@dataclass(frozen=True)
class PlanEntry:
    """What a run would do with one step."""

    step: str
    label: str
    action: PlanAction
    why: Why
    ref: Ref


class StepFailed(Exception):
    """A step gave no result. ``kind`` names the error, ``reason`` is for the user."""

    def __init__(
        self, step: str, label: str, reason: str, *, kind: str = "", retryable: bool = False
    ) -> None:
        super().__init__(step, label, reason, kind, retryable)
        self.step = step
        self.label = label
        self.reason = reason
        self.kind = kind
        self.retryable = retryable

    @property
    def name(self) -> str:
        """The step with its target, e.g. ``segment[bulldozer]``."""
        return step_name(self.step, self.label)

    def __str__(self) -> str:
        return f"{self.name}: {self.reason}"

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuild, (self.step, self.label, self.reason, self.kind, self.retryable)


def _rebuild(step: str, label: str, reason: str, kind: str, retryable: bool) -> StepFailed:
    return StepFailed(step, label, reason, kind=kind, retryable=retryable)


class Postponed(StepFailed):
    """A step that has to run was left to a later run (``RunContext.postponed``)."""

    def __init__(self, step: str, label: str) -> None:
        super().__init__(step, label, "it is left to a later run", kind="Postponed")

    def __reduce__(self) -> tuple[Any, ...]:
        return Postponed, (self.step, self.label)


class PendingValue(RuntimeError):
    """A plan asked for a value that only a run can give."""


class TimeLimit(RuntimeError):
    """An isolated step ran longer than it may."""


class MemoryLimit(RuntimeError):
    """An isolated step used more memory than it may."""


class StepCrashed(RuntimeError):
    """The process of an isolated step died, or raised an error of a foreign kind."""


class Cancelled(RuntimeError):
    """The run was stopped by the user."""


def step_name(step: str, label: str) -> str:
    """Return how a step with its target is called everywhere."""
    return f"{step}[{label}]" if label else step
