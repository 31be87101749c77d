"""A loop: no cache, no record, nothing to find again."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from flows.benchmark.orchestration.peers.peer import Pass, Run
from flows.benchmark.orchestration.pipeline import Chain


@contextmanager
def plain_python(chain: Chain, folder: Path) -> Iterator[Run]:
    """Call the functions in order."""

    def run() -> Pass:
        started = time.perf_counter()
        value = chain.first(chain.seed)
        for change in chain.changes():
            value = chain.advance(value, change)
        return Pass(time.perf_counter() - started, value)

    yield run
