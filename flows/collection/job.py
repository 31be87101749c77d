"""What a worker of a collection does for one scene: any object with ``plan`` and ``run``."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol

from flows.step_runner import Elsewhere
from storage import Store
from tasks.step import Budget, StepEvent

Report = dict[str, Any]
"""Fields of ``SceneRow`` by name; ``status`` at least."""


@dataclass(frozen=True)
class JobRun:
    """What a job is run with: call it with every step's event; hand the rest on."""

    listener: Callable[[StepEvent], None]
    engine: Literal["prefect", "local"]
    budget: Budget
    elsewhere: Elsewhere = None
    postponed: frozenset[str] = frozenset()
    """Steps before which the job stops, to be run again later."""

    def __call__(self, event: StepEvent) -> None:
        """Take one event, from any thread."""
        self.listener(event)


class Job(Protocol):
    """The work for one scene."""

    def plan(self, store: Store) -> Report | None:
        """Return the report if nothing has to run, from the store alone; else None."""

    def run(self, store: Store, events: JobRun) -> Report:
        """Do the work; an error makes the scene one that failed, with its words.

        A job that stopped before a step of ``events.postponed`` reports ``{"postponed": step}``.
        """


@dataclass(frozen=True)
class JobOrder:
    """How to make a job in any process: ``module:callable`` and its JSON arguments.

    ``models`` are those that it asks. ``stops`` are the steps, in the order in which a scene
    comes to them, before which it lets other scenes catch up (``flows.collection.passes``).
    """

    name: str
    job: str
    arguments: dict[str, Any] = field(default_factory=dict)
    models: tuple[str, ...] = ()
    stops: tuple[str, ...] = ()
    postponed: tuple[str, ...] = ()

    def make(self) -> Job:
        """Return the job."""
        module, _, name = self.job.partition(":")
        made: Job = getattr(importlib.import_module(module), name)(**self.arguments)
        return made
