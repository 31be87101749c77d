"""Answer, and die with, the process that started this one; needs only the standard library."""

from __future__ import annotations

import ctypes
import json
import os
import signal
import sys
import threading
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

    def waiting(self, waits: bool) -> None:
        """Tell that the work begins, or ends, to wait for others."""
        self.send({"waiting": waits})

    def progress(self, share: float, doing: str) -> None:
        """Tell how far the work is."""
        self.send({"progress": [float(share), doing]})
