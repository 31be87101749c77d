"""What is known of one scene of a collection, for people, pages and programs."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Literal

Status = Literal["waiting", "running", "ok", "degraded", "failed", "stopped"]
ENDED: tuple[Status, ...] = ("ok", "degraded", "failed")
WORST_FIRST: tuple[Status, ...] = ("failed", "stopped", "running", "waiting", "degraded", "ok")


@dataclass
class RunningStep:
    """A step that runs: how far it is (0..1), what it does, since when (Unix seconds)."""

    step: str
    target: str
    since: float
    share: float = 0.0
    doing: str = ""


@dataclass
class SceneRow:
    """One scene of a collection.

    ``seconds`` are those of the last run that had something to do; ``step_seconds`` sum up
    what the steps took when they were computed, by step. ``photos`` are (given,
    registered), ``objects`` (asked for, factored out). ``package`` is a folder in the
    collection's.
    """

    name: str
    status: Status = "waiting"
    reasons: list[str] = field(default_factory=list)
    seconds: float = 0.0
    executed: int = 0
    cached: int = 0
    running: list[RunningStep] = field(default_factory=list)
    package: str | None = None
    peak_mb: float = 0.0
    started: float | None = None
    finished: float | None = None
    photos: list[int] | None = None
    objects: list[int] | None = None
    step_seconds: dict[str, float] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON."""
        return dataclasses.asdict(self)

    @classmethod
    def from_json(cls, document: dict[str, Any]) -> SceneRow:
        """Read what ``to_json`` gave; fields that this version does not know are left out."""
        known = {f.name for f in dataclasses.fields(cls)}
        values = {name: value for name, value in document.items() if name in known}
        values["running"] = [RunningStep(**step) for step in values.get("running", [])]
        return cls(**values)

    def take(self, report: dict[str, Any]) -> None:
        """Take over what a job says of itself: any of the fields."""
        for f in dataclasses.fields(self):
            if f.name in report:
                setattr(self, f.name, report[f.name])


def worst_status(rows: Iterable[SceneRow]) -> Status:
    """Return the worst status of the rows, ``ok`` if there are none."""
    return min((row.status for row in rows), key=WORST_FIRST.index, default="ok")
