"""A file system that fails, dies, or loses power at its n-th call."""

from __future__ import annotations

import errno
import os
import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from storage import _os


class Killed(BaseException):
    """The process is gone: from here on nothing reaches the disk."""


class FaultyOs(_os.FileSystem):
    """Count the calls; at call ``at`` die (``kill``), lose power (``power``) or raise ``code``.

    After a power loss a file holds only what was synchronised, and a folder only the names
    that were there when it was last synchronised.
    """

    def __init__(self, at: int = -1, how: str = "kill", code: int = errno.ENOSPC) -> None:
        self.at, self.how, self.code = at, how, code
        self.calls = 0
        self.dead = False
        self.unsynced_files: set[Path] = set()
        self.unsynced_names: set[Path] = set()
        self._guard = threading.RLock()

    def _step(self) -> None:
        if self.dead:
            raise Killed
        self.calls += 1
        if self.calls - 1 != self.at:
            return
        if self.how == "error":
            raise OSError(self.code, os.strerror(self.code))
        self.dead = True
        if self.how == "power":
            self.lose_power()
        raise Killed

    def lose_power(self) -> None:
        """Forget all that was not synchronised."""
        for path in self.unsynced_files:
            if path.exists():
                path.chmod(0o644)
                path.write_bytes(b"")
        for path in sorted(self.unsynced_names, key=lambda p: -len(p.parts)):
            if path.is_dir():
                shutil.rmtree(path)
            else:
                path.unlink(missing_ok=True)

    def write(self, path: Path, data: Any) -> None:
        with self._guard:
            self._step()
            super().write(path, data)
            self.unsynced_files.add(path)
            self.unsynced_names.add(path)

    def fsync(self, path: Path) -> None:
        with self._guard:
            self._step()  # and no real fsync: nobody pulls the plug
            self.unsynced_files.discard(path)
            self.unsynced_names = {name for name in self.unsynced_names if name.parent != path}

    def mkdir(self, path: Path) -> None:
        with self._guard:
            self._step()
            super().mkdir(path)
            self.unsynced_names.add(path)

    def rename(self, source: Path, target: Path) -> None:
        with self._guard:
            self._step()
            super().rename(source, target)
            self.unsynced_files = {_moved(p, source, target) for p in self.unsynced_files}
            self.unsynced_names = {_moved(p, source, target) for p in self.unsynced_names}
            self.unsynced_names.add(target)

    def link(self, source: Path, target: Path) -> None:
        with self._guard:
            self._step()
            super().link(source, target)
            self.unsynced_names.add(target)
            if source in self.unsynced_files:
                self.unsynced_files.add(target)

    def chmod(self, path: Path, mode: int) -> None:
        with self._guard:
            self._step()
            super().chmod(path, mode)

    def unlink(self, path: Path) -> None:
        with self._guard:
            self._step()
            super().unlink(path)

    def rmdir(self, path: Path) -> None:
        with self._guard:
            self._step()
            super().rmdir(path)


def _moved(path: Path, source: Path, target: Path) -> Path:
    return target / path.relative_to(source) if path.is_relative_to(source) else path


@contextmanager
def disk(faulty: FaultyOs) -> Iterator[FaultyOs]:
    """Let the store write through ``faulty``."""
    before = _os.active
    _os.active = faulty
    try:
        yield faulty
    finally:
        _os.active = before
