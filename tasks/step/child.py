"""Compute one isolated step: ``python -m tasks.step.child PIPE PARENT ORDER``.

``ORDER`` is a JSON file (``tasks.step.isolate``); answers are JSON lines on descriptor ``PIPE``.
What libraries print goes to the standard streams and never into the answers.
"""

from __future__ import annotations

import ctypes
import dataclasses
import json
import os
import signal
import sys
import threading
import traceback
from pathlib import Path
from typing import Any

_PR_SET_PDEATHSIG = 1


def die_with(parent: int) -> None:
    """Have the system kill this process when its parent ends (Linux)."""
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


class Answers:
    """Speak to the parent, one JSON line at a time."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._guard = threading.Lock()

    def send(self, message: dict[str, Any]) -> None:
        """Write one message."""
        data = json.dumps(message).encode() + b"\n"
        with self._guard:
            while data:
                data = data[os.write(self._descriptor, data) :]

    def progress(self, share: float, doing: str) -> None:
        """Tell how far the step is."""
        self.send({"progress": [float(share), doing]})


def main() -> None:
    """Do what the order says."""
    descriptor, parent, order_file = int(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3])
    die_with(parent)
    os.set_inheritable(descriptor, False)
    answers = Answers(descriptor)
    try:
        answers.send({"done": obey(json.loads(order_file.read_text()), answers)})
    except Exception as error:
        answers.send({"error": describe(error)})
        raise SystemExit(1) from error


def obey(order: dict[str, Any], answers: Answers) -> dict[str, Any]:
    """Compute and publish; return the parts of ``Done`` as JSON."""
    sys.path[:] = order["path"]
    from tasks.step.compute import compute
    from tasks.step.order import open_store, read_order
    from tasks.step.run import RunContext, run_context

    step, arguments = read_order(order)
    store = open_store(order)
    context = RunContext(store, order["scene"], run_id=order["run_id"], isolate=False)
    with run_context(context):
        done = compute(context, step, arguments, answers.progress)
    return dataclasses.asdict(done)


def describe(error: Exception) -> dict[str, Any]:
    """Return an error as JSON."""
    from storage.redact import redact

    described: dict[str, Any] = {
        "kind": type(error).__name__,
        "message": redact(str(error)),
        "traceback": redact("".join(traceback.format_exception(error))),
    }
    if isinstance(error, OSError) and error.errno is not None:
        described |= {"errno": error.errno, "message": redact(error.strerror or str(error))}
    for name, attribute in (("object", "object_digest"), ("reason", "reason")):
        if hasattr(error, attribute):
            described[name] = getattr(error, attribute)
    return described


if __name__ == "__main__":
    main()
