"""Run a training with Prefect or in this process, and write what it gives."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Literal, TypeVar

from storage import Store
from tasks.step import RunContext, StepEvent, run_context

T = TypeVar("T")


def run_training(
    name: str,
    store: Store,
    events: Callable[[StepEvent], None],
    engine: Literal["prefect", "local"],
    body: Callable[[], T],
) -> T:
    """Return what ``body`` gives, its steps run in ``store`` by ``engine``. Raises StepFailed."""
    if engine == "local":
        return _inside(RunContext(store=store, scene=name, engine="local", events=events), body)
    from flows.prefect_flow import PrefectProgress
    from flows.training.prefect_training import training_flow

    context = RunContext(store=store, scene=name, engine="prefect", events=PrefectProgress(events))
    found: T = training_flow(name)(_inside)(context, body)
    return found


def _inside(context: RunContext, body: Callable[[], T]) -> T:
    with run_context(context):
        return body()


def write_whole(path: Path, data: bytes) -> None:
    """Write a file so that it is there whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    staged = path.with_name(f".{path.name}.{time.monotonic_ns()}")
    try:
        staged.write_bytes(data)
        staged.replace(path)
    finally:
        staged.unlink(missing_ok=True)
