"""Start a Prefect server of its own for a benchmark, and see what it costs."""

from __future__ import annotations

import os
import signal
import socket
import sqlite3
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from flows.benchmark.orchestration.process_usage import Usage, group_usage

STARTS_WITHIN_S = 120.0
STOPS_WITHIN_S = 15.0
_QUIET_SHARE = 0.1  # of one core
_QUIET_EVERY_S = 1.0
_QUIET_TIMES = 2


@dataclass(frozen=True)
class Server:
    """A running server: its API's address, its process group and its SQLite database."""

    url: str
    group: int
    home: Path

    def usage(self) -> Usage:
        """Return the CPU seconds and the memory of the server's processes."""
        return group_usage(self.group)

    def drain(self, at_most_s: float = 300.0) -> float:
        """Wait until all events are sent and the server has worked them off; return the
        seconds.
        """
        started = time.monotonic()
        flush_events(at_most_s)
        before, quiet = self.usage().cpu_s, 0
        while quiet < _QUIET_TIMES and time.monotonic() - started < at_most_s:
            time.sleep(_QUIET_EVERY_S)
            now = self.usage().cpu_s
            quiet = quiet + 1 if now - before < _QUIET_SHARE * _QUIET_EVERY_S else 0
            before = now
        return time.monotonic() - started

    def database_bytes(self) -> int:
        """Return the size of the database and of its journals."""
        return sum(path.stat().st_size for path in self.home.glob("prefect.db*"))

    def rows(self) -> dict[str, int]:
        """Return how many rows each table of the database holds."""
        with sqlite3.connect(f"file:{self.home / 'prefect.db'}?mode=ro", uri=True) as database:
            names = database.execute(
                "SELECT name FROM sqlite_master WHERE type = 'table' AND name NOT LIKE 'sqlite%'"
            ).fetchall()
            return {
                name: database.execute(f'SELECT count(*) FROM "{name}"').fetchone()[0]
                for (name,) in names
            }


@contextmanager
def prefect_server(home: Path, settings: Mapping[str, str] | None = None) -> Iterator[Server]:
    """Run a server on the loopback interface, with its database in ``home``; stop it after.

    This process' Prefect client talks to it meanwhile. ``settings`` are environment
    variables of the server. Raises RuntimeError if it does not start.
    """
    os.environ.setdefault("PREFECT_SERVER_ANALYTICS_ENABLED", "false")
    os.environ.setdefault("PREFECT_LOGGING_LEVEL", "CRITICAL")
    home.mkdir(parents=True, exist_ok=True)
    port = _free_port()
    url = f"http://127.0.0.1:{port}/api"
    environment = {**os.environ, "PREFECT_HOME": str(home), **(settings or {})}
    environment.pop("PREFECT_API_URL", None)
    command = ["-m", "prefect", "server", "start", "--host", "127.0.0.1", "--port", str(port)]
    with (home / "server.log").open("wb") as log:
        process = subprocess.Popen(
            [sys.executable, *command],
            env=environment,
            stdout=log,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
    try:
        _wait_until_healthy(url, process, home / "server.log")
        from prefect.settings import PREFECT_API_URL, temporary_settings

        with temporary_settings({PREFECT_API_URL: url}):
            yield Server(url, process.pid, home)
    finally:
        flush_events(STOPS_WITHIN_S)
        _stop(process)


def flush_events(at_most_s: float) -> None:
    """Send what this process' Prefect client still holds, and end its connection.

    The client keeps one connection a process, whatever server its settings name next; at
    its exit a process would try for minutes to reach a server that is gone.
    """
    from prefect.events.worker import EventsWorker
    from prefect.logging.handlers import APILogWorker

    for worker in (EventsWorker, APILogWorker):
        worker.drain_all(timeout=at_most_s)


def _free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return int(listener.getsockname()[1])


def _wait_until_healthy(url: str, process: subprocess.Popen[bytes], log: Path) -> None:
    deadline = time.monotonic() + STARTS_WITHIN_S
    while time.monotonic() < deadline and process.poll() is None:
        with suppress(urllib.error.URLError, OSError), urllib.request.urlopen(f"{url}/health") as r:
            if r.status == 200:
                return
        time.sleep(0.2)
    tail = log.read_text(errors="replace")[-2000:]
    raise RuntimeError(f"the Prefect server did not start; the end of its log:\n{tail}")


def _stop(process: subprocess.Popen[bytes]) -> None:
    for number in (signal.SIGINT, signal.SIGKILL):
        with suppress(ProcessLookupError):
            os.killpg(process.pid, number)
        with suppress(subprocess.TimeoutExpired):
            process.wait(STOPS_WITHIN_S)
            break
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
