"""Keep models loaded for many processes: ``python -m tasks.model.keeper SOCKET PARENT BUDGET``.

``SOCKET`` is the descriptor of a Unix socket that listens, ``BUDGET`` a budget's JSON. Each
connection speaks JSON lines (docs/model_workers.md) and is a user of at most one model at a
time; a process that goes away takes its question with it. The keeper and its workers die with
the process that started it.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import struct
import sys
import threading
from pathlib import Path
from typing import Any

from storage.redact import redact
from tasks.model.desk import Desk, Question
from tasks.model.exchange import sweep
from tasks.model.launch import Launch, launch_from_json
from tasks.model.worker_error import to_json
from tasks.model_worker import protocol
from tasks.parent_process import Answers, die_with
from tasks.step.budget import Budget


def main() -> None:
    """Serve until the parent ends."""
    descriptor, parent = int(sys.argv[1]), int(sys.argv[2])
    die_with(parent)
    os.set_inheritable(descriptor, False)
    signal.signal(signal.SIGTERM, lambda _number, _frame: sys.exit(0))
    sweep()
    budget = Budget.from_json(json.loads(sys.argv[3]))
    if len(budget.cores) < (os.cpu_count() or 1):
        budget.confine()
    desk = Desk(budget)
    try:
        serve(socket.socket(fileno=descriptor), desk)
    finally:
        desk.close()


def serve(listening: socket.socket, desk: Desk) -> None:
    """Answer connections, each in a thread of its own, until the socket is closed."""
    while True:
        try:
            connection, _ = listening.accept()
        except OSError:
            return
        threading.Thread(target=_attend, args=(connection, desk), daemon=True).start()


def _attend(connection: socket.socket, desk: Desk) -> None:
    with connection:
        if _is_ours(connection):
            _Attendant(connection, desk).attend()


def _is_ours(connection: socket.socket) -> bool:
    """Tell whether the other side is a process of the same user (Linux; elsewhere the folder's
    permissions say so).
    """
    if not hasattr(socket, "SO_PEERCRED"):
        return True
    size = struct.calcsize("3i")
    _pid, uid, _gid = struct.unpack(
        "3i", connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, size)
    )
    return bool(uid == os.getuid())


class _Attendant:
    """One connection."""

    def __init__(self, connection: socket.socket, desk: Desk) -> None:
        self._connection = connection
        self._desk = desk
        self._answers = Answers(connection.fileno())
        self._gone = threading.Event()
        self._uses: Launch | None = None

    def attend(self) -> None:
        """Answer until the other side hangs up."""
        try:
            self._answers.send({protocol.HELLO: {"protocol": protocol.VERSION}})
            with self._connection.makefile("rb") as lines:
                for line in lines:
                    message = json.loads(line)
                    threading.Thread(target=self._obey, args=(message,), daemon=True).start()
        except (OSError, ValueError):
            pass
        finally:
            self._gone.set()
            self._use(None)

    def _obey(self, message: dict[str, Any]) -> None:
        try:
            if protocol.STATUS in message:
                self._answers.send({protocol.STATUS: self._desk.tally.to_json()})
            else:
                self._ask(message[protocol.ASK])
        except OSError:
            self._gone.set()

    def _ask(self, ask: dict[str, Any]) -> None:
        launch = launch_from_json(ask["launch"])
        self._use(launch)
        folder, digest = Path(ask["folder"]), ask["digest"]
        question = Question(launch, folder, digest, self._tell, self._gone)
        self._desk.put(question)
        while not question.done.wait(1.0):
            if self._gone.is_set():
                return
        outcome = question.outcome
        if isinstance(outcome, Exception):
            error = to_json(outcome)
            self._answers.send({protocol.ERROR: error | {"message": redact(error["message"])}})
        else:
            self._answers.send({protocol.ANSWER: outcome})

    def _tell(self, share: float, doing: str) -> None:
        try:
            self._answers.progress(share, doing)
        except OSError:
            self._gone.set()

    def _use(self, launch: Launch | None) -> None:
        if launch == self._uses:
            return
        if self._uses is not None:
            self._desk.use(self._uses, -1)
        if launch is not None:
            self._desk.use(launch, +1)
        self._uses = launch


if __name__ == "__main__":
    main()
