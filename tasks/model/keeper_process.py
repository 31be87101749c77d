"""Start the keeper of this machine's models for all that this process starts."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from garden_models.foundation.failure import ModelFailed
from tasks.model.keeper_client import VARIABLE, KeeperClient
from tasks.model.tally import added
from tasks.step.budget import Budget
from tasks.step.slots import runtime_folder

ByModel = dict[str, dict[str, Any]]
"""What each model cost (``tally.Cost`` as JSON)."""

Costs = Callable[[], ByModel]
"""Returns what each model cost so far."""

_JUST_MADE_S = 60.0

GRACE_S = 5.0
"""How long a keeper may take to end its workers."""

MOST_STARTS = 20
"""A keeper that died as often is not started again."""


def kept_by() -> dict[str, str]:
    """Return the environment variable that tells a process of the keeper."""
    return {VARIABLE: os.environ[VARIABLE]}


def is_wanted() -> bool:
    """Tell whether a keeper may be started: there is none yet, and nobody said ``off``."""
    return not os.environ.get(VARIABLE)


@contextmanager
def model_keeper(budget: Budget | None = None) -> Iterator[Costs]:
    """Have all processes that are started inside ask their models of one keeper.

    It uses the cores and GPUs of ``budget``, of the machine if none is given. One that dies is
    started again. It ends with this process, and its workers with it. The last costs are known
    afterwards too.
    """
    before = os.environ.get(VARIABLE)
    sweep_sockets(runtime_folder())
    address = runtime_folder() / f"keeper-{uuid.uuid4().hex[:12]}.sock"
    kept = _Kept(address, budget or Budget.of_machine())
    os.environ[VARIABLE] = str(kept.address)
    try:
        yield kept.costs
    finally:
        kept.costs()
        if before is None:
            del os.environ[VARIABLE]
        else:
            os.environ[VARIABLE] = before
        kept.end()


def sweep_sockets(folder: Path) -> None:
    """Remove the sockets of keepers whose processes were killed."""
    for path in folder.glob("keeper-*.sock"):
        with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX) as trial:
            if time.time() - path.stat().st_mtime < _JUST_MADE_S:
                continue
            try:
                trial.connect(str(path))
            except ConnectionRefusedError:
                path.unlink()


class _Kept:
    """The keeper's socket, and the thread that keeps a keeper on it."""

    def __init__(self, address: Path, budget: Budget) -> None:
        self.address = address
        self._budget = json.dumps(budget.to_json())
        self._socket = socket.socket(socket.AF_UNIX)
        self._socket.bind(str(address))
        address.chmod(0o600)
        self._socket.listen(128)
        self._ending = threading.Event()
        self._started = threading.Event()
        self._process: subprocess.Popen[bytes] | None = None
        self._now: ByModel = {}
        self._before: ByModel = {}  # what keepers that died had counted
        self._thread = threading.Thread(target=self._keep, daemon=True)
        self._thread.start()
        self._started.wait()

    def costs(self) -> ByModel:
        """Return what each model cost so far, as far as the keeper tells."""
        if not self._ending.is_set():
            with contextlib.suppress(ModelFailed):
                client = KeeperClient(self.address)
                self._now = client.status()
                client.close()
        return added(self._before, self._now)

    def end(self) -> None:
        """End the keeper with all its workers."""
        self._ending.set()
        signals = (signal.SIGTERM, signal.SIGKILL)
        while self._thread.is_alive():  # it may just be starting another one
            for number in signals:
                if self._process is not None:
                    self._process.send_signal(number)
                self._thread.join(timeout=GRACE_S)
                if not self._thread.is_alive():
                    break
        self._socket.close()
        self.address.unlink(missing_ok=True)

    def _keep(self) -> None:
        for _ in range(MOST_STARTS):
            self._process = self._start()
            self._started.set()
            self._process.wait()
            if self._ending.is_set():
                return
            self._before, self._now = added(self._before, self._now), {}
        self._socket.close()  # who asks is told that there is none

    def _start(self) -> subprocess.Popen[bytes]:
        descriptor = self._socket.fileno()
        words = ["-m", "tasks.model.keeper", str(descriptor), str(os.getpid()), self._budget]
        return subprocess.Popen(
            [sys.executable, *words],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            pass_fds=(descriptor,),
            start_new_session=True,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        )
