"""Our steps: in this process, reading every value too, and as Prefect task runs."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from flows.benchmark.orchestration.peers.peer import Pass, Run
from flows.benchmark.orchestration.pipeline import Chain
from flows.benchmark.orchestration.pipeline_steps import STEPS
from storage import Store
from tasks.step import Ref, RunContext, load, run_context

_SCENE = "chain"


@contextmanager
def local_steps(chain: Chain, folder: Path) -> Iterator[Run]:
    """Give references; a hit is looked up and verified."""
    yield _local(chain, Store.open(folder / "store"), read=False)


@contextmanager
def local_steps_read(chain: Chain, folder: Path) -> Iterator[Run]:
    """Load the value of every step as well."""
    yield _local(chain, Store.open(folder / "store"), read=True)


@contextmanager
def prefect_steps(chain: Chain, folder: Path) -> Iterator[Run]:
    """Run every step as a task of one flow run."""
    from flows.prefect_flow import scene_flow

    store = Store.open(folder / "store")

    def body() -> Pass:
        return _pass(chain, read=False)

    def run() -> Pass:
        with run_context(RunContext(store, _SCENE, "prefect")):
            outcome: Pass = scene_flow(_SCENE)(body)()
            return outcome

    yield run


def _local(chain: Chain, store: Store, *, read: bool) -> Run:
    def run() -> Pass:
        with run_context(RunContext(store, _SCENE)):
            return _pass(chain, read=read)

    return run


def _pass(chain: Chain, *, read: bool) -> Pass:
    first, advance = STEPS[chain.name]

    def told(ref: Ref) -> Any:
        return load(ref, chain.kind) if read else ref

    started = time.perf_counter()
    ref = first(chain.seed)
    told(ref)
    for change in chain.changes():
        ref = advance(ref, change, label=f"{change.index:04}")
        told(ref)
    seconds = time.perf_counter() - started
    return Pass(seconds, load(ref, chain.kind))
