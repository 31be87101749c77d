"""Give a step the model that it names, wherever this machine runs it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from garden_models.progress import AS_BEFORE, Progress, silent
from tasks.model.checked import check_answer
from tasks.model.keeper_client import KeeperClient, KeeperGone, keeper_address
from tasks.model.launch import launch_of
from tasks.model.resident import residents
from tasks.model_worker.nouns import nouns_of
from tasks.step.run import is_stopped


@contextmanager
def predictor(name: str, progress: Progress = silent) -> Iterator[Callable[[Any], Any]]:
    """Give what asks a model: called with a request, it returns the answer.

    The model is loaded at the first call, and stays loaded until another one needs its device.
    The same request has the same answer, whatever was asked before. ``progress`` is told what
    the model is doing, not how far.

    Raises:
        BadInput: there is no such model, or what it needs is not here; says what to do.
        ModelOutOfMemory: (of a call) it does not fit; ask for less at once.
        ModelFailed: (of a call) it gave no usable answer.
    """
    launch = launch_of(name)
    _request, expected = nouns_of(launch.module)
    with _asking() as ask:

        def report(_share: float, doing: str) -> None:
            progress(AS_BEFORE, doing)

        def predict(request: Any) -> Any:
            answer = ask(launch, request, report, is_stopped)
            check_answer(name, request, answer, expected)
            return answer

        yield predict


@contextmanager
def _asking() -> Iterator[Callable[..., Any]]:
    """Give what asks a model: the keeper's, if there is a keeper, else one of this process."""
    address = keeper_address()
    if address is None:
        yield residents.ask
        return
    asking = _ThroughKeeper(address)
    try:
        yield asking.ask
    finally:
        asking.close()


class _ThroughKeeper:
    """A connection to the keeper; a new one, once for each question, to one that came after it."""

    def __init__(self, address: Path) -> None:
        self._address = address
        self._guard = threading.Lock()
        self._client = KeeperClient(address)

    def ask(self, *question: Any) -> Any:
        """Return the answer."""
        client = self._client
        try:
            return client.ask(*question)
        except KeeperGone:
            return self._next(client).ask(*question)

    def _next(self, gone: KeeperClient) -> KeeperClient:
        with self._guard:  # of several threads the first one connects
            if self._client is gone:
                gone.close()
                self._client = KeeperClient(self._address)
            return self._client

    def close(self) -> None:
        """Hang up."""
        self._client.close()
