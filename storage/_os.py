"""Make every change to the disk here, so that tests can make any of them fail.

All of ``storage`` writes through ``active``. A test replaces it by a file system that
kills the process, runs out of space or forgets what was not synchronised at the n-th call.
"""

from __future__ import annotations

import os
from pathlib import Path


class FileSystem:
    """The system calls that the store's protocol is made of."""

    def write(self, path: Path, data: bytes | memoryview) -> None:
        """Create ``path``, which must not exist, with ``data``; not yet durable."""
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
        try:
            rest = memoryview(data).cast("B")
            while rest:
                rest = rest[os.write(descriptor, rest) :]
        finally:
            os.close(descriptor)

    def fsync(self, path: Path) -> None:
        """Make a file's bytes, or a folder's entries, durable."""
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)

    def chmod(self, path: Path, mode: int) -> None:
        """Change the permission bits of ``path``."""
        path.chmod(mode)

    def mkdir(self, path: Path) -> None:
        """Create one folder; FileExistsError if it is there."""
        path.mkdir()

    def rename(self, source: Path, target: Path) -> None:
        """Move ``source`` to ``target`` in one step."""
        source.rename(target)

    def link(self, source: Path, target: Path) -> None:
        """Give the file ``source`` a second name; FileExistsError if it is taken."""
        os.link(source, target)

    def touch(self, path: Path) -> None:
        """Make a file as young as a new one; FileNotFoundError if there is none."""
        os.utime(path)

    def unlink(self, path: Path) -> None:
        """Remove a file."""
        path.unlink()

    def rmdir(self, path: Path) -> None:
        """Remove an empty folder."""
        path.rmdir()


active = FileSystem()


def ensure_folder(path: Path, *, durable: bool) -> None:
    """Create ``path`` and its missing parents, each made durable in its parent."""
    if path.is_dir():
        return
    ensure_folder(path.parent, durable=durable)
    try:
        active.mkdir(path)
    except FileExistsError:
        return
    if durable:
        active.fsync(path.parent)


def remove_tree(path: Path) -> None:
    """Remove a folder and all below it; what is already gone is fine."""
    try:
        entries = list(os.scandir(path))
    except FileNotFoundError:
        return
    for entry in entries:
        if entry.is_dir(follow_symlinks=False):
            remove_tree(Path(entry.path))
        else:
            try:
                active.unlink(Path(entry.path))
            except FileNotFoundError:
                continue
    try:
        active.rmdir(path)
    except FileNotFoundError:
        return
