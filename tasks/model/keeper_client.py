"""Ask the keeper of this machine's models, if there is one."""

from __future__ import annotations

import json
import os
import select
import socket
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from garden_models.foundation.failure import ModelFailed
from tasks.model.ask_worker import ask_worker
from tasks.model.launch import Launch, launch_to_json
from tasks.model.worker import Report
from tasks.model.worker_error import raised_in_worker
from tasks.model_worker import protocol
from tasks.step.ref import Cancelled
from tasks.step.waiting import waiting

VARIABLE = "GARDEN_KEEPER"
OFF = "off"
KEEPER = "the models' keeper"
HELLO_S = 120.0
"""How long a keeper may take to start, or to tell what models cost."""

_POLL_S = 0.1


def keeper_address() -> Path | None:
    """Return the keeper's socket, None if models run in this process.

    ``$GARDEN_KEEPER`` names it; ``off`` wants none.
    """
    given = os.environ.get(VARIABLE)
    return Path(given) if given and given != OFF else None


class KeeperGone(ModelFailed):
    """There is no keeper, or it went away; another one may be there already."""


class KeeperClient:
    """A connection to the keeper. While it lasts, the keeper counts on more questions."""

    def __init__(self, address: Path) -> None:
        self._one_at_a_time = threading.Lock()
        self._socket = socket.socket(socket.AF_UNIX)
        self._buffer = b""
        try:
            self._socket.connect(str(address))
            hello = self._expect(protocol.HELLO, KEEPER, tell_nobody, _after(HELLO_S))
        except OSError as error:
            self._socket.close()
            raise _gone(error) from None
        except Cancelled:
            raise ModelFailed(f"{KEEPER} did not start within {HELLO_S:g} s") from None
        if hello.get("protocol") != protocol.VERSION:
            self.close()
            raise ModelFailed(
                f"{KEEPER} speaks {hello.get('protocol')}, and this GARDEN"
                f" {protocol.VERSION}: start the run again"
            )

    def ask(self, launch: Launch, request: Any, report: Report, stopped: Callable[[], bool]) -> Any:
        """Return a model's answer; raises as ``ModelWorker.ask`` does."""

        def ask(folder: Path, digest: str) -> dict[str, Any]:
            question = {
                "launch": launch_to_json(launch),
                "folder": str(folder),
                "digest": digest,
            }
            with self._one_at_a_time:
                self._send({protocol.ASK: question})
                return self._expect(protocol.ANSWER, launch.name, report, stopped)

        return ask_worker(ask, launch, request)

    def status(self) -> dict[str, dict[str, Any]]:
        """Return what each model cost so far (``tally.Cost``)."""
        self._send({protocol.STATUS: True})
        return self._expect(protocol.STATUS, KEEPER, tell_nobody, _after(HELLO_S))

    def close(self) -> None:
        """Hang up: the keeper counts on no more questions from here."""
        self._socket.close()

    def _send(self, message: dict[str, Any]) -> None:
        try:
            self._socket.sendall(json.dumps(message).encode() + b"\n")
        except OSError as error:
            raise _gone(error) from None

    def _expect(
        self, word: str, name: str, report: Report, stopped: Callable[[], bool]
    ) -> dict[str, Any]:
        with ExitStack() as its_turn:
            its_turn.enter_context(waiting())
            while True:
                for message in self._messages():
                    its_turn.close()
                    if protocol.PROGRESS in message:
                        report(*message[protocol.PROGRESS])
                    elif protocol.ERROR in message:
                        raise raised_in_worker(name, message[protocol.ERROR])
                    else:
                        found: dict[str, Any] = message[word]
                        return found
                if stopped():
                    self.close()
                    raise Cancelled("the run was stopped")

    def _messages(self) -> list[dict[str, Any]]:
        ready, _, _ = select.select([self._socket], [], [], _POLL_S)
        if not ready:
            return []
        try:
            data = self._socket.recv(1 << 16)
        except OSError as error:
            raise _gone(error) from None
        if not data:
            raise _gone(None)
        *lines, self._buffer = (self._buffer + data).split(b"\n")
        return [json.loads(line) for line in lines]


def tell_nobody(share: float, doing: str) -> None:
    """Ignore what a model is doing."""


def _after(seconds: float) -> Callable[[], bool]:
    """Return what tells whether so many seconds have gone by."""
    deadline = time.monotonic() + seconds
    return lambda: time.monotonic() > deadline


def _gone(error: OSError | None) -> KeeperGone:
    why = f" ({error.strerror})" if error is not None and error.strerror else ""
    return KeeperGone(f"{KEEPER} is gone{why}: start the run again")
