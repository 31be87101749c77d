"""Sample what this process, the processes it started and a Prefect server use over time."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from flows.benchmark.orchestration.process_usage import Usage, children_usage, process_usage
from flows.benchmark.orchestration.server import Server

EVERY_S = 1.0
_NOTHING = Usage(0.0, 0, 0)


@dataclass(frozen=True)
class Sample:
    """Usage at one time (``time.time``). ``parent`` counts children that have ended too."""

    time: float
    parent: Usage
    workers: Usage
    server: Usage

    @property
    def ours_rss(self) -> int:
        """Bytes of parent and workers."""
        return self.parent.rss + self.workers.rss

    @property
    def ours_cpu_s(self) -> float:
        """CPU seconds of parent and workers since they started."""
        return self.parent.cpu_s + self.workers.cpu_s


@contextmanager
def sampled(server: Server | None, every_s: float = EVERY_S) -> Iterator[list[Sample]]:
    """Give a list that grows by one sample every so many seconds, and one at the end."""
    samples = [_sample(server)]
    stop = threading.Event()

    def sample() -> None:
        while not stop.wait(every_s):
            samples.append(_sample(server))

    thread = threading.Thread(target=sample, name="samples", daemon=True)
    thread.start()
    try:
        yield samples
    finally:
        stop.set()
        thread.join()
        samples.append(_sample(server))


def _sample(server: Server | None) -> Sample:
    group = None if server is None else server.group
    return Sample(
        time.time(),
        process_usage(os.getpid()),
        children_usage(os.getpid(), without_group=group),
        _NOTHING if server is None else server.usage(),
    )
