"""Start the keeper of this machine's models for all that this process starts."""

from __future__ import annotations

import contextlib
import os
import socket
import subprocess
import sys
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from garden_models.foundation.failure import ModelFailed
from tasks.model.keeper_client import VARIABLE, KeeperClient
from tasks.step.slots import runtime_folder

Costs = Callable[[], dict[str, dict[str, Any]]]
"""Returns what each model cost so far (``tally.Cost`` as JSON)."""


def kept_by() -> dict[str, str]:
    """Return the environment variable that tells a process of the keeper."""
    return {VARIABLE: os.environ[VARIABLE]}


def is_wanted() -> bool:
    """Tell whether a keeper may be started: there is none yet, and nobody said ``off``."""
    return not os.environ.get(VARIABLE)


@contextmanager
def model_keeper() -> Iterator[Costs]:
    """Have all processes that are started inside ask their models of one keeper.

    It ends with this process, and its workers with it. The last costs are known afterwards too.
    """
    address = runtime_folder() / f"keeper-{uuid.uuid4().hex[:12]}.sock"
    process = _start(address)
    before = os.environ.get(VARIABLE)
    os.environ[VARIABLE] = str(address)
    known: dict[str, dict[str, Any]] = {}

    def costs() -> dict[str, dict[str, Any]]:
        if process.poll() is None:
            with contextlib.suppress(ModelFailed, OSError):
                client = KeeperClient(address)
                known.update(client.status())
                client.close()
        return known

    try:
        yield costs
    finally:
        costs()
        if before is None:
            del os.environ[VARIABLE]
        else:
            os.environ[VARIABLE] = before
        process.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(timeout=10)
        process.kill()
        process.wait()
        address.unlink(missing_ok=True)


def _start(address: Path) -> subprocess.Popen[bytes]:
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(address))
        address.chmod(0o600)
        listening.listen(128)
        return subprocess.Popen(
            [
                sys.executable,
                "-m",
                "tasks.model.keeper",
                str(listening.fileno()),
                str(os.getpid()),
            ],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            pass_fds=(listening.fileno(),),
            start_new_session=True,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        )
