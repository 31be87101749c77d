"""Start a Prefect server for one program: ``python -m`` this module with SOCKET and PARENT.

Prefect's own temporary server outlives a program that is killed, and is waited for; this one dies
with it, and starts while the program does other things.
"""

from __future__ import annotations

import atexit
import contextlib
import functools
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from flows.server_profile import SERVER_PROFILES
from tasks.parent_process import die_with

START_S = 180.0


def begin_server() -> None:
    """Start this process' own server already if one will be needed; return at once.

    Call it before Prefect is imported, which takes about as long.
    """
    if not _may_be_configured() and threading.current_thread() is threading.main_thread():
        _begun_server()


def _may_be_configured() -> bool:
    if "prefect" in sys.modules:
        from prefect.settings import PREFECT_API_URL

        return bool(PREFECT_API_URL.value())
    home = Path(os.environ.get("PREFECT_HOME", Path.home() / ".prefect"))
    profiles = Path(os.environ.get("PREFECT_PROFILES_PATH", home / "profiles.toml"))
    return "PREFECT_API_URL" in os.environ or profiles.exists()


@contextmanager
def at_server() -> Iterator[str]:
    """Have Prefect's client in this context speak to ``server_address``; give it."""
    from prefect.settings import PREFECT_API_URL, temporary_settings

    address = server_address()
    with temporary_settings({PREFECT_API_URL: address}):
        yield address


def server_address() -> str:
    """Return the API address of the server that is configured, else of this process' own.

    That one is started when it is first asked for and ends with the process: Prefect still
    sends to it when a flow run has ended. Raises RuntimeError if it does not start.
    """
    from prefect.settings import PREFECT_API_URL

    configured = PREFECT_API_URL.value()
    return str(configured) if configured else _own_server()


@functools.cache
def _own_server() -> str:
    address, process = _begun_server()
    _wait_for(address, process)
    return address


@functools.cache
def _begun_server() -> tuple[str, subprocess.Popen[bytes]]:
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        listening.listen(128)
        process = subprocess.Popen(
            [sys.executable, "-m", __name__, str(listening.fileno()), str(os.getpid())],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            pass_fds=(listening.fileno(),),
            start_new_session=True,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        )
        address = f"http://127.0.0.1:{listening.getsockname()[1]}/api"
    _started.append(process)
    return address, process


_started: list[subprocess.Popen[bytes]] = []


@atexit.register  # before Prefect is imported: after what it still has to send
def _stop() -> None:
    for process in _started:
        process.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(timeout=15)
        process.kill()


def _wait_for(address: str, process: subprocess.Popen[bytes]) -> None:
    import httpx

    deadline = time.monotonic() + START_S
    while time.monotonic() < deadline and process.poll() is None:
        with contextlib.suppress(httpx.HTTPError):
            if httpx.get(f"{address}/health", timeout=5.0).status_code == httpx.codes.OK:
                return
        time.sleep(0.1)
    raise RuntimeError(
        f"the Prefect server did not start within {START_S:g} s: try `prefect server start`, or"
        " --engine local"
    )


def main() -> None:
    """Serve on the socket until the program ends."""
    descriptor, parent = int(sys.argv[1]), int(sys.argv[2])
    die_with(parent)
    settings = {"PREFECT_SERVER_ANALYTICS_ENABLED": "false"} | SERVER_PROFILES["lean"]
    os.environ |= {name: value for name, value in settings.items() if name not in os.environ}
    import uvicorn
    from prefect.server.api.server import create_app

    listening = socket.socket(fileno=descriptor)
    server = uvicorn.Server(uvicorn.Config(create_app(), log_level="error", lifespan="on"))
    server.run(sockets=[listening])


if __name__ == "__main__":
    main()
