"""Make a training a Prefect flow run (imported only when something has to run)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from prefect import Flow, flow
from prefect.task_runners import ThreadPoolTaskRunner

from flows.prefect_flow import MAX_TASKS


def training_flow(name: str) -> Callable[[Callable[..., Any]], Flow[..., Any]]:
    """Return the decorator that makes a function the flow run of a training."""
    return flow(
        name="train",
        flow_run_name=name,
        task_runner=ThreadPoolTaskRunner(max_workers=MAX_TASKS),
        validate_parameters=False,
        persist_result=False,
    )
