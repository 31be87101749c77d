"""Let steps run at once only as far as cores, memory and GPUs go, over all processes.

All runs of a user on one machine share the slots (``tasks.step.slots``), so that two cores
or one GPU are full but never over-full, also with several ``garden batch`` at once.
"""

from __future__ import annotations

import contextvars
import math
import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from garden_models.scene import BadInput
from tasks.step.machine import usable_cores, usable_gpus, usable_memory_gb
from tasks.step.ref import Cancelled
from tasks.step.slots import Ticket, runtime_folder

MEMORY_SLOT_GB = 0.5
_POLL_S = 0.2


@dataclass(frozen=True)
class Need:
    """What a step takes while it runs; ``all`` cores are all of the budget."""

    cores: int | Literal["all"] = 1
    memory_gb: float = 1.0
    gpus: int = 0


ONE_CORE = Need()


@dataclass(frozen=True)
class Held:
    """What a step has got: the GPUs' names, and the seconds it waited for all of it."""

    gpus: tuple[str, ...] = ()
    waited: float = 0.0


@dataclass(frozen=True)
class Budget:
    """The part of the machine that steps may use together.

    ``cores`` and ``gpus`` name those that may be used, ``folder`` is where the slots lie.
    """

    cores: tuple[int, ...]
    memory_gb: float
    gpus: tuple[str, ...]
    folder: Path

    @classmethod
    def of_machine(
        cls,
        cores: int | None = None,
        memory_gb: float | None = None,
        gpus: int | None = None,
        folder: Path | None = None,
    ) -> Budget:
        """Return what the machine, or the cgroup, has; or as much of it as is given.

        Raises BadInput for more cores or GPUs than there are, or for none.
        """
        all_cores, all_gpus = usable_cores(), usable_gpus()
        return cls(
            all_cores if cores is None else all_cores[: _within(cores, 1, len(all_cores), "cores")],
            usable_memory_gb() if memory_gb is None else _positive(memory_gb),
            all_gpus if gpus is None else all_gpus[: _within(gpus, 0, len(all_gpus), "GPUs")],
            runtime_folder() if folder is None else folder,
        )

    @classmethod
    def from_json(cls, document: dict[str, Any]) -> Budget:
        """Read what ``to_json`` gave."""
        return cls(
            tuple(document["cores"]),
            document["memory_gb"],
            tuple(document["gpus"]),
            Path(document["folder"]),
        )

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON."""
        return {
            "cores": list(self.cores),
            "memory_gb": self.memory_gb,
            "gpus": list(self.gpus),
            "folder": str(self.folder),
        }

    @contextmanager
    def hold(self, need: Need, cancelled: threading.Event) -> Iterator[Held]:
        """Take what a step needs, waiting until it is free; give it back at the end.

        A need that is larger than the budget takes all of it. What runs inside of a step
        that holds its part already takes no more.

        Raises Cancelled if the run is stopped while it waits.
        """
        if _holding.get():
            yield Held()
            return
        started = time.monotonic()
        ticket = Ticket(self.folder, self._request(need), self._pool())
        token = _holding.set(True)
        try:
            _wait(ticket, cancelled)
            gpus = ticket.slots.get("gpu", ())
            yield Held(gpus, time.monotonic() - started)
        finally:
            _holding.reset(token)
            ticket.give_back()

    def confine(self) -> None:
        """Keep this process, and what it starts, on the budget's cores (Linux)."""
        if hasattr(os, "sched_setaffinity"):
            os.sched_setaffinity(0, self.cores)

    def _pool(self) -> dict[str, tuple[str, ...]]:
        return {
            "core": tuple(str(core) for core in self.cores),
            "memory": tuple(str(i) for i in range(self._memory_slots)),
            "gpu": self.gpus,
        }

    @property
    def _memory_slots(self) -> int:
        return max(1, int(self.memory_gb / MEMORY_SLOT_GB))

    def _request(self, need: Need) -> dict[str, int]:
        cores = len(self.cores) if need.cores == "all" else need.cores
        return {
            "core": min(cores, len(self.cores)),
            "memory": min(math.ceil(need.memory_gb / MEMORY_SLOT_GB), self._memory_slots),
            "gpu": min(need.gpus, len(self.gpus)),
        }


_holding: contextvars.ContextVar[bool] = contextvars.ContextVar("garden_holding", default=False)


def is_holding() -> bool:
    """Tell whether this code runs inside of a step that holds its part of the budget."""
    return _holding.get()


def _wait(ticket: Ticket, cancelled: threading.Event) -> None:
    while not ticket.try_take():
        ticket.wait(_POLL_S)
        if cancelled.is_set():
            raise Cancelled("the run was stopped")


def _within(count: int, least: int, most: int, what: str) -> int:
    if not least <= count <= most:
        raise BadInput(f"{count} {what} were asked for: there are {most}")
    return count


def _positive(memory_gb: float) -> float:
    if not memory_gb > 0:
        raise BadInput(f"{memory_gb} GB of memory were asked for: give a positive number")
    return memory_gb
