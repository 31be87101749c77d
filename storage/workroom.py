"""Give folders on this machine to a store that is elsewhere, and clear up after the dead."""

from __future__ import annotations

import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from storage import _os, staging
from storage.errors import StoreFull, StoreReadOnly


@contextmanager
def folder() -> Iterator[Path]:
    """Give an empty folder in the system's temporary folder; remove it at the end."""
    room = _room()
    staging.sweep(room)
    with staging.staging_folder(room) as place:
        yield place


def sweep() -> int:
    """Remove the folders of dead processes of this user; return how many."""
    return staging.sweep(_room())


def full() -> StoreFull:
    """Return the error for a temporary folder without room."""
    return StoreFull(
        f"the temporary folder {tempfile.gettempdir()} is full, in which results are written"
        " before they are uploaded: free space there, or name a roomier one with TMPDIR"
    )


def _room() -> Path:
    """Return this user's own folder; nobody else may write into it or stand in for it."""
    room = Path(tempfile.gettempdir()) / f"garden-{os.getuid()}"
    _os.ensure_folder(room.parent, durable=False)
    try:
        _os.active.mkdir(room)
        _os.active.chmod(room, 0o700)
    except FileExistsError:
        pass
    found = room.lstat()
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or found.st_mode & 0o022:
        raise StoreReadOnly(
            f"{room} belongs to another user, or others may write into it: remove it, or name"
            " another temporary folder with TMPDIR"
        )
    return room
