"""Keep what one step, or one scene, took: once a mode and repetition."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from tasks.step import Seconds, step_name

Mode = Literal["cold", "cached", "warm"]
MODES: tuple[Mode, ...] = ("cold", "cached", "warm")

PARTS = ("load", "compute", "publish", "wait")

EVALUATION_ONLY = frozenset({"render"})
"""Steps that only a report or an evaluation needs; the paper leaves their time out."""

DEFINITIONS: dict[Mode, str] = {
    "cold": "every step executed, from an empty store, in a fresh process",
    "cached": "the whole scene found in the store: its plan with every verified look-up, and the "
    "check of its package, as in a rerun with nothing to do",
    "warm": "every step executed again (forced) in a process that has run the scene before: "
    "modules imported, caches hot",
}


@dataclass(frozen=True)
class StepTiming:
    """One step of one scene in one mode; times in seconds.

    ``started`` and ``ended`` are in Unix seconds. ``seconds`` and ``peak_mb`` are those of
    an execution, ``lookup_s`` that of a look-up; None is what the mode does not have.
    """

    scene: str
    target: str
    step: str
    mode: Mode
    repeat: int
    seconds: Seconds | None = None
    lookup_s: float | None = None
    started: float | None = None
    ended: float | None = None
    peak_mb: float | None = None
    backend: str = ""
    host: str = ""
    run_id: str = ""
    key: str = ""

    @property
    def name(self) -> str:
        """The step with its target."""
        return step_name(self.step, self.target)

    @property
    def total_s(self) -> float:
        """All seconds of the execution, or of the look-up."""
        return self.seconds.total if self.seconds is not None else self.lookup_s or 0.0

    @property
    def evaluation_only(self) -> bool:
        """Whether totals leave it out."""
        return self.step in EVALUATION_ONLY

    @property
    def span(self) -> tuple[float, float] | None:
        """When it waited or worked, in Unix seconds."""
        if self.seconds is None or self.started is None or self.ended is None:
            return None
        return self.started - self.seconds.wait, self.ended


@dataclass(frozen=True)
class SceneTiming:
    """One scene in one mode and repetition.

    ``objects`` are the targets asked for. ``missing`` names the steps of which nothing is
    known: with any, the scene has no totals. ``wall_s`` is the clock of the flow (for
    ``cached``, of plan and package check), ``process_s`` of the whole process from its
    start until the package is written; None where it was not measured.
    """

    scene: str
    mode: Mode
    repeat: int
    objects: tuple[str, ...]
    steps: tuple[StepTiming, ...]
    missing: tuple[str, ...] = ()
    wall_s: float | None = None
    process_s: float | None = None

    @property
    def complete(self) -> bool:
        """Whether every step of the scene has its time."""
        return bool(self.steps) and not self.missing
