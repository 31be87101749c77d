"""redun with its documented settings: a lazy graph of tasks, results in an SQLite database."""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from flows.benchmark.orchestration.peers.peer import Pass, Run
from flows.benchmark.orchestration.pipeline import Chain

_FRAMES_A_STEP = 40  # a chain is a nested expression, which redun walks by recursion


@contextmanager
def redun_scheduler(chain: Chain, folder: Path) -> Iterator[Run]:
    """Evaluate the chain as one expression, by the local executor's threads."""
    from redun import Scheduler, task  # type: ignore[import-not-found]
    from redun.config import Config  # type: ignore[import-not-found]

    logging.getLogger("redun").setLevel(logging.ERROR)
    first, advance = (
        task(name=function.__name__, namespace="garden_benchmark")(function)
        for function in (chain.first, chain.advance)
    )
    folder.mkdir(parents=True, exist_ok=True)
    database = {"db_uri": f"sqlite:///{folder / 'redun.db'}"}
    scheduler = Scheduler(config=Config({"backend": database}))
    scheduler.load()

    def run() -> Pass:
        with _deep(chain.length):
            started = time.perf_counter()
            expression: Any = first(chain.seed)
            for change in chain.changes():
                expression = advance(expression, change)
            value = scheduler.run(expression)
            return Pass(time.perf_counter() - started, value)

    yield run


@contextmanager
def _deep(length: int) -> Iterator[None]:
    limit = sys.getrecursionlimit()
    sys.setrecursionlimit(max(limit, 1000 + _FRAMES_A_STEP * length))
    try:
        yield
    finally:
        sys.setrecursionlimit(limit)
