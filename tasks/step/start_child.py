"""Start a child process for an isolated step, also before there is an order for it.

What a child imports takes longer than starting it: a spare one has that behind it when its order
comes. All children of a run are started by one thread that lives as long as the run, since
the system ends a child with the *thread* that started it (``tasks.parent_process.die_with``).
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import threading
import time
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from storage import Store
from tasks.step.child_process import ChildProcess


@dataclass(frozen=True)
class Surroundings:
    """What a child takes over from this process when it is started.

    Prefect's variables are left out of it: no step asks for them, and its client, which is
    imported after the first child is started, sets some.
    """

    environment: dict[str, str]
    folder: str

    @classmethod
    def now(cls) -> Surroundings:
        """Return those that a child would get that is started now."""
        kept = {k: v for k, v in os.environ.items() if not k.startswith("PREFECT_")}
        path = os.pathsep.join(filter(None, sys.path))
        return cls(kept | {"PYTHONPATH": path}, str(Path.cwd()))


@dataclass
class StartedChild:
    """A child that waits for its order; ``end`` it in any case."""

    child: ChildProcess
    surroundings: Surroundings
    _stack: ExitStack

    def obey(self, order: dict[str, Any]) -> ChildProcess:
        """Give the order; what the child says of it is heard from the one that is returned."""
        stdin = self.child.process.stdin
        assert stdin is not None
        with contextlib.suppress(BrokenPipeError):  # it died: its end of the other pipe says so
            stdin.write(json.dumps(order).encode() + b"\n")
            stdin.close()
        self.child.started = time.monotonic()
        return self.child

    def end(self) -> None:
        """Kill the child with all that it started, and remove what it printed."""
        self._stack.close()


def start_child(store: Store) -> StartedChild:
    """Start a child that imports what all steps need, and then waits for its order.

    Raises OSError, StoreError.
    """
    surroundings = Surroundings.now()
    with ExitStack() as stack:
        output = stack.enter_context(store.scratch()) / "output.txt"
        reading, writing = os.pipe()
        stack.callback(os.close, reading)
        try:
            # Unbuffered: what a child that crashes printed last is often why.
            with output.open("wb") as printed:
                process = subprocess.Popen(
                    [
                        *(sys.executable, "-u", "-m", "tasks.step.child"),
                        *(str(writing), str(os.getpid())),
                    ],
                    stdin=subprocess.PIPE,
                    stdout=printed,
                    stderr=subprocess.STDOUT,
                    pass_fds=(writing,),
                    start_new_session=True,
                    env=surroundings.environment,
                )
        finally:
            os.close(writing)
        child = ChildProcess(process, reading, output)
        stack.callback(_end, child)
        return StartedChild(child, surroundings, stack.pop_all())


def _end(child: ChildProcess) -> None:
    child.kill()
    with contextlib.suppress(OSError):
        assert child.process.stdin is not None
        child.process.stdin.close()


class SpareChild:
    """Keep one child ready for the next isolated step of a run; ``close`` it in any case."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._guard = threading.Lock()
        self._starter = ThreadPoolExecutor(1, "children")
        self._spare: Future[StartedChild] | None = None

    def prepare(self) -> None:
        """Start a child, if there is none yet; return at once."""
        with self._guard:
            if self._spare is None:
                self._spare = self._starter.submit(start_child, self._store)

    def take(self) -> StartedChild:
        """Return the child that was prepared, or a new one if it would not do; start another.

        Raises OSError, StoreError.
        """
        with self._guard:
            spare, self._spare = self._spare, None
        started = None if spare is None else _usable(spare)
        if started is None:
            started = self._starter.submit(start_child, self._store).result()
        self.prepare()
        return started

    def close(self) -> None:
        """End the child that nobody took, and the thread."""
        with self._guard:
            spare, self._spare = self._spare, None
        self._starter.shutdown()
        if spare is not None and spare.exception() is None:
            spare.result().end()


def _usable(spare: Future[StartedChild]) -> StartedChild | None:
    """Return a child that lives and has the surroundings that one would get now."""
    if spare.exception() is not None:
        return None
    started = spare.result()
    lives = started.child.process.poll() is None
    if lives and started.surroundings == Surroundings.now():
        return started
    started.end()
    return None
