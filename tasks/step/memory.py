"""Measure how much memory a step takes, from /proc."""

from __future__ import annotations

import contextvars
import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_PAGE = os.sysconf("SC_PAGE_SIZE")
_EVERY_S = 0.1
_MB = 1e6


class Peak:
    """The highest resident memory seen so far, in MB."""

    def __init__(self) -> None:
        self.mb = 0.0

    def see(self, rss_bytes: int) -> None:
        """Take one more sample."""
        self.mb = max(self.mb, rss_bytes / _MB)


class _Sampler:
    """One thread that samples this process for all steps that run in it."""

    def __init__(self) -> None:
        self._watched: set[Peak] = set()
        self._guard = threading.Lock()
        self._thread: threading.Thread | None = None

    def add(self, peak: Peak) -> None:
        with self._guard:
            self._watched.add(peak)
            if self._thread is None or not self._thread.is_alive():
                self._thread = threading.Thread(target=self._sample, name="memory", daemon=True)
                self._thread.start()

    def remove(self, peak: Peak) -> None:
        with self._guard:
            self._watched.discard(peak)

    def _sample(self) -> None:
        while True:
            rss = process_rss(os.getpid())
            with self._guard:
                if not self._watched:
                    self._thread = None
                    return
                for peak in self._watched:
                    peak.see(rss)
            time.sleep(_EVERY_S)


_sampler = _Sampler()


_of_step: contextvars.ContextVar[Peak] = contextvars.ContextVar("garden_peak")


def see_elsewhere(held_bytes: int) -> None:
    """Count memory that another process holds for the step that this code is part of."""
    peak = _of_step.get(None)
    if peak is not None:
        peak.see(process_rss(os.getpid()) + held_bytes)


@contextmanager
def peak_memory() -> Iterator[Peak]:
    """Watch this process' resident memory while a step runs in it.

    Steps that run at the same time in one process see each other's memory.
    """
    peak = Peak()
    peak.see(process_rss(os.getpid()))
    _sampler.add(peak)
    token = _of_step.set(peak)
    try:
        yield peak
    finally:
        _of_step.reset(token)
        _sampler.remove(peak)
        peak.see(process_rss(os.getpid()))


def process_rss(pid: int) -> int:
    """Return the resident bytes of a process, 0 if it is gone."""
    try:
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * _PAGE
    except (OSError, IndexError, ValueError):
        return 0


def session_rss(session: int) -> int:
    """Return the resident bytes of all processes of a session (a child and its children)."""
    total = 0
    for entry in os.scandir("/proc"):
        if entry.name.isdigit() and _session_of(entry.name) == session:
            total += process_rss(int(entry.name))
    return total


def _session_of(pid: str) -> int:
    try:
        status = Path(f"/proc/{pid}/stat").read_bytes()  # a name may be of any bytes
        return int(status[status.rindex(b")") + 2 :].split()[3])
    except (OSError, IndexError, ValueError):
        return -1
