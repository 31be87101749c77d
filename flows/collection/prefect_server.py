"""Start a Prefect server for one batch: ``python -m`` this module with SOCKET and PARENT.

Prefect's own temporary server outlives a killed batch; this one dies with it.
"""

from __future__ import annotations

import atexit
import contextlib
import functools
import os
import socket
import subprocess
import sys
import time

from flows.server_profile import SERVER_PROFILES
from tasks.parent_process import die_with

START_S = 180.0


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
    _wait_for(address, process)
    return address


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
    """Serve on the socket until the batch ends."""
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
