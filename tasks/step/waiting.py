"""Tell the time in which a step waits for others from the time that it takes itself.

What waits for its turn (at a model that others ask too) is not computing: its time limit does
not run, and reports show it as waiting.
"""

from __future__ import annotations

import contextvars
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager


def tell_nobody(waits: bool) -> None:
    """Ignore that a step begins, or ends, to wait."""


class Waits:
    """How long one step has waited, in seconds."""

    def __init__(self, tell: Callable[[bool], None]) -> None:
        self._tell = tell
        self.seconds = 0.0

    @contextmanager
    def waiting(self) -> Iterator[None]:
        """Count the time inside as waiting."""
        started = time.monotonic()
        self._tell(True)
        try:
            yield
        finally:
            self._tell(False)
            self.seconds += time.monotonic() - started


_current: contextvars.ContextVar[Waits] = contextvars.ContextVar("garden_waits")


@contextmanager
def counted_waits(tell: Callable[[bool], None] = tell_nobody) -> Iterator[Waits]:
    """Count what the step that runs inside waits; ``tell`` is called when it begins and ends."""
    waits = Waits(tell)
    token = _current.set(waits)
    try:
        yield waits
    finally:
        _current.reset(token)


@contextmanager
def waiting() -> Iterator[None]:
    """Count the time inside as waiting of the step that this code is part of, if any."""
    waits = _current.get(None)
    if waits is None:
        yield
        return
    with waits.waiting():
        yield
