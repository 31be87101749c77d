"""Prefect's own cache with its documented settings: INPUTS + TASK_SOURCE, results persisted."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from flows.benchmark.orchestration.peers.peer import Pass, Run
from flows.benchmark.orchestration.pipeline import Chain


@contextmanager
def prefect_cache(chain: Chain, folder: Path) -> Iterator[Run]:
    """Call the tasks in order in one flow run; a hit loads the value."""
    import prefect
    from prefect.cache_policies import INPUTS, TASK_SOURCE
    from prefect.settings import PREFECT_LOCAL_STORAGE_PATH, temporary_settings

    from flows.prefect_flow import scene_flow

    policy = INPUTS + TASK_SOURCE
    first, advance = (
        prefect.task(function, cache_policy=policy, persist_result=True)
        for function in (chain.first, chain.advance)
    )

    def body() -> Pass:
        started = time.perf_counter()
        value = first(chain.seed)
        for change in chain.changes():
            value = advance(value, change)
        return Pass(time.perf_counter() - started, value)

    def run() -> Pass:
        with temporary_settings({PREFECT_LOCAL_STORAGE_PATH: folder / "results"}):
            outcome: Pass = scene_flow("chain")(body)()
            return outcome

    yield run
