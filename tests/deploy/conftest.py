"""A real Prefect server and worker for the tests, as a user starts them."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import pytest

ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Service:
    """A running Prefect server, and the environment of all that talks to it."""

    api: str
    environment: dict[str, str]
    home: Path

    @contextlib.contextmanager
    def client(self) -> Iterator[Any]:
        from prefect.client.orchestration import get_client
        from prefect.settings import PREFECT_API_URL, temporary_settings

        with (
            temporary_settings({PREFECT_API_URL: self.api}),
            get_client(sync_client=True) as client,
        ):
            yield client

    def prefect(self, *arguments: str, **more: str) -> str:
        """Run a Prefect command against the server; give what it printed."""
        return self.python("-m", "prefect", *arguments, **more)

    def python(self, *arguments: str, **more: str) -> str:
        done = subprocess.run(
            [sys.executable, *arguments],
            cwd=ROOT, env=self.environment | more, capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextlib.contextmanager
def background(command: list[str], environment: dict[str, str], log: Path) -> Iterator[Any]:
    """Keep a command running in a group of its own; end it and all that it started afterwards."""
    with log.open("w") as output:
        process = subprocess.Popen(
            command, cwd=ROOT, env=environment, stdout=output, stderr=output, start_new_session=True
        )
        try:
            yield process
        finally:
            started = descendants(process.pid)  # a worker's flow runs have groups of their own
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGINT)
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(6)
            for pid in (process.pid, *started):
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            process.wait()


def descendants(pid: int) -> list[int]:
    """Return the processes that a process started, and those that they started."""
    children = defaultdict(list)
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            name, fields = path.parent.name, path.read_text().rpartition(")")[2].split()
            children[int(fields[1])].append(int(name))
    found = [pid]
    for parent in found:
        found += children[parent]
    return found[1:]


def wait_for(what: str, check: Callable[[], Any], seconds: float) -> Any:
    """Return the first true value of ``check``, or fail after ``seconds``."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        if value := check():
            return value
        time.sleep(0.3)
    pytest.fail(f"waited {seconds} s in vain for {what}")


@contextlib.contextmanager
def prefect_service(home: Path, **more: str) -> Iterator[Service]:
    """Run ``prefect server start`` on a free loopback port until the block ends."""
    port = free_port()
    api = f"http://127.0.0.1:{port}/api"
    environment = {
        name: value for name, value in os.environ.items() if not name.startswith("PREFECT_")
    }
    environment |= {
        "PREFECT_HOME": str(home),
        "PREFECT_API_URL": api,
        "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
        "DO_NOT_TRACK": "1",
        "PYTHONPATH": os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]),
        "GARDEN_STORE": str(home / "store"),
        "PREFECT_SERVER_SERVICES_SCHEDULER_LOOP_SECONDS": "2",
        "COLUMNS": "200",
        **more,
    }
    command = [sys.executable, "-m", "prefect", "server", "start", "--host", "127.0.0.1"]
    log = home / "server.log"
    with background([*command, "--port", str(port)], environment, log) as process:

        def is_up() -> bool:
            assert process.poll() is None, log.read_text()
            with contextlib.suppress(httpx.HTTPError):
                return httpx.get(f"{api}/health", timeout=2).is_success
            return False

        wait_for("the server", is_up, 240)
        yield Service(api, environment, home)


@pytest.fixture(scope="session")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """One server for all tests here."""
    with prefect_service(tmp_path_factory.mktemp("service")) as running:
        yield running


@pytest.fixture(scope="session")
def pool(service: Service) -> Iterator[Service]:
    """The server with everything registered, and one worker of the pool ``garden``."""
    service.python("deploy/register.py", "--out", str(service.home / "scenes"))
    command = [sys.executable, "-m", "prefect", "worker", "start", "--pool", "garden"]
    environment = service.environment | {"PREFECT_WORKER_QUERY_SECONDS": "2"}
    with background(command, environment, service.home / "worker.log"):
        yield service
