"""A file system that fails, dies, or loses power at its n-th call."""

from __future__ import annotations

import errno
import os
import random
import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from storage import _os


class Killed(BaseException):
    """The process is gone: from here on nothing reaches the disk."""


@dataclass
class _Change:
    """A change of names that the disk may forget until a folder it concerns is synchronised."""

    what: str
    path: Path
    source: Path | None = None
    lost: bytes | None = None

    def concerns(self, folder: Path) -> bool:
        return folder in (self.path.parent, self.source.parent if self.source else None)

    def move(self, source: Path, target: Path) -> None:
        self.path = _moved(self.path, source, target)
        self.source = self.source and _moved(self.source, source, target)


class FaultyOs(_os.FileSystem):
    """Count the calls; at call ``at`` die, lose power or raise ``code``.

    ``how`` is ``kill``, ``error``, ``power`` (all that was not synchronised is undone: bytes
    of files, new, moved and removed names) or ``torn`` (of these a random part, since a disk
    may write them in any order).
    """

    def __init__(self, at: int = -1, how: str = "kill", code: int = errno.ENOSPC) -> None:
        self.at, self.how, self.code = at, how, code
        self.operations: list[str] = []
        self.dead = False
        self.unsynced_files: set[Path] = set()
        self.changes: list[_Change] = []
        self._guard = threading.RLock()

    @property
    def calls(self) -> int:
        return len(self.operations)

    def _step(self, operation: str) -> None:
        if self.dead:
            raise Killed
        self.operations.append(operation)
        if self.calls - 1 != self.at:
            return
        if self.how == "error":
            raise OSError(self.code, os.strerror(self.code))
        self.dead = True
        if self.how in ("power", "torn"):
            self.lose_power(torn=self.how == "torn")
        raise Killed

    def lose_power(self, *, torn: bool = False) -> None:
        """Forget all that was not synchronised, or a random part of it."""
        chance = random.Random(self.at)
        for change in reversed(self.changes):
            if not torn or chance.random() < 0.5:
                self._undo(change)
        for path in sorted(self.unsynced_files):
            if path.exists() and (not torn or chance.random() < 0.5):
                path.chmod(0o644)
                path.write_bytes(b"")

    def _undo(self, change: _Change) -> None:
        path, source = change.path, change.source
        if change.what == "made":
            if path.is_dir():
                shutil.rmtree(path)
            else:
                path.unlink(missing_ok=True)
        elif not path.parent.is_dir() or (source and not source.parent.is_dir()):
            return  # inside of something that is gone, too
        elif change.what == "removed folder":
            path.mkdir(exist_ok=True)
        elif change.what == "removed":
            if not path.exists():
                path.write_bytes(change.lost or b"")
                path.chmod(0o444)
        elif source and path.exists() and not source.exists():
            path.rename(source)
            for other in self.changes:
                other.move(path, source)
            self.unsynced_files = {_moved(p, path, source) for p in self.unsynced_files}
            if change.lost is not None:
                path.write_bytes(change.lost)

    def write(self, path: Path, data: Any) -> None:
        with self._guard:
            self._step("write")
            super().write(path, data)
            self.unsynced_files.add(path)
            self.changes.append(_Change("made", path))

    def fsync(self, path: Path) -> None:
        with self._guard:
            self._step("fsync")  # and no real fsync: nobody pulls the plug
            self.unsynced_files.discard(path)
            self.changes = [change for change in self.changes if not change.concerns(path)]

    def mkdir(self, path: Path) -> None:
        with self._guard:
            self._step("mkdir")
            super().mkdir(path)
            self.changes.append(_Change("made", path))

    def rename(self, source: Path, target: Path) -> None:
        with self._guard:
            self._step("rename")
            lost = target.read_bytes() if target.is_file() else None
            super().rename(source, target)
            self.unsynced_files = {_moved(p, source, target) for p in self.unsynced_files}
            for change in self.changes:
                change.move(source, target)
            self.changes.append(_Change("moved", target, source, lost))

    def link(self, source: Path, target: Path) -> None:
        with self._guard:
            self._step("link")
            super().link(source, target)
            self.changes.append(_Change("made", target))
            if source in self.unsynced_files:
                self.unsynced_files.add(target)

    def chmod(self, path: Path, mode: int) -> None:
        with self._guard:
            self._step("chmod")
            super().chmod(path, mode)

    def touch(self, path: Path) -> None:
        with self._guard:
            self._step("touch")
            super().touch(path)

    def unlink(self, path: Path) -> None:
        with self._guard:
            self._step("unlink")
            lost = path.read_bytes() if path.exists() else b""
            super().unlink(path)
            self.unsynced_files.discard(path)
            self.changes.append(_Change("removed", path, lost=lost))

    def rmdir(self, path: Path) -> None:
        with self._guard:
            self._step("rmdir")
            super().rmdir(path)
            self.changes.append(_Change("removed folder", path))


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
