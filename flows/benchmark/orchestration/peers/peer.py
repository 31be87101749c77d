"""Say what a peer is: how it is opened, what it needs, what one pass over the chain gave."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flows.benchmark.orchestration.pipeline import Chain


@dataclass(frozen=True)
class Pass:
    """One run of the whole chain: seconds of its steps, and the last artifact."""

    seconds: float
    value: Any


Run = Callable[[], Pass]


@dataclass(frozen=True)
class Peer:
    """A way to run a chain.

    ``note`` says what a hit gives. ``caches`` is False where every pass runs every step,
    ``on_server`` is True where a Prefect server has to take part.
    """

    name: str
    open: Callable[[Chain, Path], AbstractContextManager[Run]]
    note: str = ""
    caches: bool = True
    on_server: bool = False
    package: str = ""
