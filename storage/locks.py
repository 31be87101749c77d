"""Wait for a lock of the file system, but never without end.

The system drops a lock with the process that held it. What is left to fear is a process that
is stopped while it holds one: waiting for it ends in an error.
"""

from __future__ import annotations

import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PATIENCE_S = 600.0
_PAUSE_S = (0.0005, 0.05)


@contextmanager
def shared(place: Path, patience_s: float = PATIENCE_S) -> Iterator[None]:
    """Hold the lock at ``place`` together with others; TimeoutError if it is not to be had."""
    descriptor = _open(place)
    try:
        with _turn(place, patience_s):
            _take(descriptor, fcntl.LOCK_SH, place, patience_s)
        yield
    finally:
        os.close(descriptor)


@contextmanager
def alone(place: Path, patience_s: float = PATIENCE_S) -> Iterator[None]:
    """Hold the lock at ``place`` alone; TimeoutError if it is not to be had."""
    descriptor = _open(place)
    try:
        with _turn(place, patience_s):
            _take(descriptor, fcntl.LOCK_EX, place, patience_s)
        yield
    finally:
        os.close(descriptor)


@contextmanager
def _turn(place: Path, patience_s: float) -> Iterator[None]:
    """Queue: while one waits to be alone, no more others come in before it."""
    queue = place.with_suffix(".turn")
    descriptor = _open(queue)
    try:
        _take(descriptor, fcntl.LOCK_EX, queue, patience_s)
        yield
    finally:
        os.close(descriptor)


def _open(place: Path) -> int:
    return os.open(place, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)


def _take(descriptor: int, how: int, place: Path, patience_s: float) -> None:
    deadline = time.monotonic() + patience_s
    pause = _PAUSE_S[0]
    while True:
        try:
            fcntl.flock(descriptor, how | fcntl.LOCK_NB)
            return
        except BlockingIOError:
            if time.monotonic() >= deadline:
                raise TimeoutError(
                    f"{place} has been locked by another process for {patience_s:.0f} s: see"
                    " which process holds it open (fuser), and continue or end it"
                ) from None
        time.sleep(pause)
        pause = min(2 * pause, _PAUSE_S[1])
