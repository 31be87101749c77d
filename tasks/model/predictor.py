"""Give a step the model that it names, wherever this machine runs it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from tasks.model.launch import launch_of
from tasks.model.resident import residents


@contextmanager
def predictor(name: str) -> Iterator[Callable[[Any], Any]]:
    """Give what asks a model: called with a request, it returns the answer.

    The model is loaded at the first call, and stays loaded until another one needs its device.

    Raises:
        BadInput: there is no such model, or what it needs is not here; says what to do.
        ModelOutOfMemory: (of a call) it does not fit; ask for less at once.
        ModelFailed: (of a call) it gave no usable answer.
    """
    launch = launch_of(name)

    def predict(request: Any) -> Any:
        return residents.call(launch, request)

    yield predict
