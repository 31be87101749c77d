"""Hear, weigh and end a child process that answers in JSON lines on a pipe.

It leads a session of its own, so that all that it starts is weighed and ended with it.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import subprocess
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from storage.redact import redact
from tasks.step.memory import Peak, session_rss

_WEIGH_EVERY_S = 0.3
_TAIL_CHARACTERS = 2000
_READ_BYTES = 1 << 16
_LONGEST_LINE = 8 << 20


class Garbled(ValueError):
    """A child wrote something on its pipe that is no JSON object on a line."""


@dataclass
class ChildProcess:
    """A running child; ``peak`` is the most memory that its session was seen to hold."""

    process: subprocess.Popen[bytes]
    answers: int  # descriptor of the pipe on which the child speaks
    output: Path  # what it, and its libraries, print
    started: float = field(default_factory=time.monotonic)
    peak: Peak = field(default_factory=Peak)
    weigh_at: float = 0.0  # when its memory is looked at next
    buffer: bytes = b""
    silent: bool = False  # it has closed its end of the pipe
    waited_s: float = 0.0  # for others, up to now
    waits_since: float | None = None

    def messages(self, wait_s: float) -> Iterator[dict[str, Any]]:
        """Give what the child says; wait for it no longer than ``wait_s``.

        Raises Garbled.
        """
        ready, _, _ = select.select([self.answers], [], [], wait_s)
        if not ready:
            return
        data = os.read(self.answers, 1 << 16)
        if not data:
            self.silent = True
            return
        *lines, self.buffer = (self.buffer + data).split(b"\n")
        if len(self.buffer) > _LONGEST_LINE:
            raise Garbled(f"a line of more than {_LONGEST_LINE >> 20} MB")
        for line in lines:
            yield _message(line)

    def waits(self, begins: bool) -> None:
        """Note that the child begins, or ends, to wait for others."""
        now = time.monotonic()
        if self.waits_since is not None:
            self.waited_s += now - self.waits_since
        self.waits_since = now if begins else None

    def busy_s(self) -> float:
        """Return the seconds since its start in which it did not wait for others."""
        now = time.monotonic()
        waiting = 0.0 if self.waits_since is None else now - self.waits_since
        return now - self.started - self.waited_s - waiting

    def weigh(self) -> None:
        """Look at the memory of the child and all that it started, not too often."""
        now = time.monotonic()
        if now >= self.weigh_at:
            self.weigh_at = now + _WEIGH_EVERY_S
            self.peak.see(session_rss(self.process.pid))

    def tail(self) -> str:
        """Return the end of what the child printed, cut after secrets are out of it."""
        try:
            with self.output.open("rb") as printed:
                printed.seek(max(0, self.output.stat().st_size - _READ_BYTES))
                text = printed.read().decode(errors="replace")
        except OSError:
            return ""
        return redact(text)[-_TAIL_CHARACTERS:].strip()

    def kill(self) -> None:
        """End the child and all that it started."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()

    def how_it_died(self) -> str:
        """Say how a child that is silent ended, with the last that it printed."""
        try:
            code = self.process.wait(timeout=5.0)
        except subprocess.TimeoutExpired:
            return "its process closed the connection without a result"
        if code < 0:
            how = f"its process was ended by {signal.Signals(-code).name}"
        else:
            how = f"its process ended with code {code} and no result"
        tail = self.tail()
        return f"{how}; it printed last: {tail}" if tail else how


def _message(line: bytes) -> dict[str, Any]:
    shown = line[:80].decode(errors="replace")
    try:
        message = json.loads(line)
    except ValueError:
        raise Garbled(shown) from None
    if not isinstance(message, dict):
        raise Garbled(shown)
    return message
