"""Start, feed, hear and end one worker of a collection."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from typing import IO, Any

from flows.collection.job import JobOrder
from flows.collection.worker import WorkerSetting, to_json
from tasks.step.memory import process_rss

MOST_JOBS = 100
MOST_RSS_GB = 2.5
"""A worker is replaced after so many jobs, or when it keeps so much memory between two."""

GRACE_S = 10.0
_TAIL_BYTES = 1000


class WorkerProcess:
    """A process that does one job at a time; ``job`` is the name of the one it does."""

    def __init__(self, setting: WorkerSetting, environment: dict[str, str]) -> None:
        reading, writing = os.pipe()
        self._output: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - closed in end()
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "flows.collection.worker", str(writing), str(os.getpid())],
                stdin=subprocess.PIPE,
                stdout=self._output,
                stderr=subprocess.STDOUT,
                pass_fds=(writing,),
                start_new_session=True,
                env=environment | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            )
        finally:
            os.close(writing)
        self.answers = reading
        self.job: str | None = None
        self.started = 0.0
        self._done = 0
        self._buffer = b""
        self._say(to_json(setting))

    def give(self, order: JobOrder) -> None:
        """Have the worker do a job."""
        self.job, self.started = order.name, time.time()
        self._say(json.dumps(dataclasses.asdict(order)) + "\n")

    def hear(self) -> list[dict[str, Any]] | None:
        """Return what the worker said since the last time, None if it is gone."""
        data = os.read(self.answers, 1 << 16)
        if not data:
            return None
        *lines, self._buffer = (self._buffer + data).split(b"\n")
        return [json.loads(line) for line in lines]

    def finish_job(self) -> None:
        """Note that the job has ended."""
        self.job = None
        self._done += 1

    @property
    def is_worn(self) -> bool:
        """Whether a fresh worker should take its place."""
        too_large = process_rss(self._process.pid) > MOST_RSS_GB * 1e9
        return self._done >= MOST_JOBS or too_large

    def how_it_died(self) -> str:
        """Say how a worker that is gone ended, with the last that it printed."""
        try:
            code = self._process.wait(timeout=GRACE_S)
        except subprocess.TimeoutExpired:
            return "the scene's process closed the connection"
        how = f"the scene's process ended with code {code} and no result"
        if code < 0:
            name = signal.Signals(-code).name
            hint = " (for lack of memory?)" if -code == signal.SIGKILL else ""
            how = f"the scene's process was ended by {name}{hint}"
        tail = self._tail()
        return f"{how}; it printed last: {tail}" if tail else how

    def ask_to_end(self) -> None:
        """Have the worker stop what it does and end."""
        with contextlib.suppress(OSError):
            self._process.terminate()

    def end(self, grace_s: float = 0.0) -> None:
        """End the worker with all that it started; wait ``grace_s`` for it to do so itself."""
        with contextlib.suppress(OSError):
            assert self._process.stdin is not None
            self._process.stdin.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(timeout=grace_s)
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        os.close(self.answers)
        self._output.close()

    def _say(self, line: str) -> None:
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # it died: its end of the other pipe says so
            self._process.stdin.write(line.encode())
            self._process.stdin.flush()

    def _tail(self) -> str:
        self._output.seek(0, os.SEEK_END)
        self._output.seek(max(0, self._output.tell() - _TAIL_BYTES))
        return self._output.read().decode(errors="replace").strip()
