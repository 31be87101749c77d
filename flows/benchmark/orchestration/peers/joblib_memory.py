"""joblib.Memory with its documented settings: results pickled, found by a hash of arguments."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from flows.benchmark.orchestration.peers.peer import Pass, Run
from flows.benchmark.orchestration.pipeline import Chain


@contextmanager
def joblib_memory(chain: Chain, folder: Path) -> Iterator[Run]:
    """Call the cached functions in order; a hit loads the value, which the next step hashes."""
    from joblib import Memory  # type: ignore[import-untyped, import-not-found]

    memory = Memory(folder / "joblib", verbose=0)
    first, advance = memory.cache(chain.first), memory.cache(chain.advance)

    def run() -> Pass:
        started = time.perf_counter()
        value = first(chain.seed)
        for change in chain.changes():
            value = advance(value, change)
        return Pass(time.perf_counter() - started, value)

    yield run
