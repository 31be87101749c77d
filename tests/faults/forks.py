"""Start processes within milliseconds, end them at any moment, and hear what they found.

Forking is only safe from a process without threads: trials run in a process of their own,
``python -m tests.faults.MODULE``, that imports everything and starts none.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.faults.part import Count


def fork(work: Callable[[], object], log: Path) -> int:
    """Do ``work`` in a process of its own; return its id. What it raises goes to ``log``."""
    child = os.fork()
    if child:
        return child
    code = 1
    try:
        work()
        code = 0
    except BaseException:  # noqa: BLE001 (a child must not return into its parent's code)
        tell(log, traceback.format_exc())
    finally:
        os._exit(code)


def tell(log: Path, text: str) -> None:
    """Add a line to a file, whole even beside others that do."""
    line = text.strip().replace("\n", " | ") + "\n"
    descriptor = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    os.write(descriptor, line.encode())
    os.close(descriptor)


def told(log: Path) -> list[str]:
    """Return the lines of such a file and empty it."""
    lines = log.read_text().splitlines() if log.exists() else []
    log.unlink(missing_ok=True)
    return lines


def kill(child: int) -> None:
    """End a process at once (a dead one too)."""
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)


def wait(children: list[int], seconds: float) -> list[int]:
    """Wait for processes; kill and return those that are not done in time."""
    deadline = time.monotonic() + seconds
    late = []
    for child in children:
        while os.waitpid(child, os.WNOHANG) == (0, 0):
            if time.monotonic() > deadline:
                kill(child)
                late.append(child)
                break
            time.sleep(0.005)
    return late


def in_own_process(module: str, *words: str) -> list[Count]:
    """Run ``python -m tests.faults.MODULE``, which prints its counts as JSON; return them."""
    command = [sys.executable, "-m", f"tests.faults.{module}", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        return [Count(f"{module} ended by itself", 1, (done.stderr[-2000:],))]
    return [Count(c["what"], c["trials"], tuple(c["violations"])) for c in json.loads(done.stdout)]


def print_counts(counts: list[Count]) -> None:
    """Print counts for ``in_own_process``."""
    plain: list[dict[str, Any]] = [
        {"what": c.what, "trials": c.trials, "violations": c.violations} for c in counts
    ]
    print(json.dumps(plain))
