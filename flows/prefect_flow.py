"""Wrap a scene's run as a Prefect flow (imported only when something has to run)."""

from __future__ import annotations

import functools
import os
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any

os.environ.setdefault("PREFECT_SERVER_ANALYTICS_ENABLED", "false")
os.environ.setdefault("PREFECT_LOGGING_LEVEL", "CRITICAL")
# A busy server answers 503: try for eight minutes, each pause twice the last, instead of for one,
# since a scene whose flow run cannot be recorded fails.
os.environ.setdefault("PREFECT_CLIENT_MAX_RETRIES", "8")

import httpx
from prefect import flow, tags
from prefect.artifacts import create_progress_artifact, update_progress_artifact
from prefect.context import TagsContext
from prefect.settings import (
    PREFECT_FLOWS_HEARTBEAT_FREQUENCY,
    get_current_settings,
    temporary_settings,
)
from prefect.task_runners import ThreadPoolTaskRunner

from tasks.step import StepEvent, step_name

MAX_TASKS = 8
"""Task runs of one scene at once; heavy ones limit themselves to the cores."""

PROGRESS_EVERY_S = 2.0
"""Each update of Prefect's page is a request to its server."""

_DEPLOYED_RUN = "PREFECT__FLOW_RUN_ID"

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


def scene_flow(scene: str) -> Decorator:
    """Return the decorator that makes a function the flow run of ``scene``."""
    return _flow("factorize-scene", scene)


def collection_flow(collection: str) -> Decorator:
    """Return the decorator that makes a function the flow run of ``collection``."""
    return _flow("factorize-collection", collection)


def of_collection(collection: str) -> AbstractContextManager[Any]:
    """Mark the flow runs that start inside as those of a collection."""
    return tags(f"collection:{collection}")


def _flow(name: str, run_name: str) -> Decorator:
    as_flow = flow(
        name=name,
        flow_run_name=run_name.replace("{", "(").replace("}", ")"),
        task_runner=ThreadPoolTaskRunner(max_workers=MAX_TASKS),
        validate_parameters=False,
        persist_result=False,
    )

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        run = as_flow(_with_untagged_tasks(function))

        @functools.wraps(function)
        def call(*args: Any, **kwargs: Any) -> Any:
            with _heartbeats_if_heard():
                return run(*args, **kwargs)

        return call

    return decorate


@contextmanager
def _heartbeats_if_heard() -> Iterator[None]:
    """Send heartbeats only if somebody set how often, or a worker of a deployment began this.

    A flow run that sends them takes up to a second longer to end; what hears them is the
    automation that marks the runs of machines that are gone, which would block a deployment.
    """
    current = get_current_settings()
    if "heartbeat_frequency" in current.flows.model_fields_set or _DEPLOYED_RUN in os.environ:
        yield
        return
    with temporary_settings({PREFECT_FLOWS_HEARTBEAT_FREQUENCY: None}):
        yield


def _with_untagged_tasks(function: Callable[..., Any]) -> Callable[..., Any]:
    """Keep a flow run's tags from its tasks, which would ask the server for a slot for each."""

    @functools.wraps(function)
    def body(*args: Any, **kwargs: Any) -> Any:
        with TagsContext(current_tags=set()):
            return function(*args, **kwargs)

    return body


class PrefectProgress:
    """A sink of step events that shows them as progress in Prefect's page, and passes them on.

    What the page shows is a courtesy: a server that does not answer stops no scene.
    """

    def __init__(self, events: Callable[[StepEvent], None]) -> None:
        self._events = events
        self._artifacts: dict[str, uuid.UUID] = {}
        self._shown: dict[str, float] = {}
        self._lock = threading.Lock()

    def __call__(self, event: StepEvent) -> None:
        """Take one event, from any thread."""
        self._events(event)
        if event.kind == "progress" and self._is_due(event):
            self._show(event, event.share or 0.0)
        elif event.kind == "finished" and step_name(event.step, event.label) in self._artifacts:
            self._show(event, 1.0)

    def _is_due(self, event: StepEvent) -> bool:
        name, now = step_name(event.step, event.label), time.monotonic()
        with self._lock:
            if now - self._shown.get(name, -PROGRESS_EVERY_S) < PROGRESS_EVERY_S:
                return False
            self._shown[name] = now
            return True

    def _show(self, event: StepEvent, share: float) -> None:
        name = step_name(event.step, event.label)
        text = f"{event.scene}: {name} {event.doing}".strip()
        try:
            if name in self._artifacts:
                update_progress_artifact(self._artifacts[name], 100 * share, text)
            else:
                shown = create_progress_artifact(100 * share, description=text)
                if isinstance(shown, uuid.UUID):
                    self._artifacts[name] = shown
        except httpx.HTTPError:
            self._artifacts.pop(name, None)
