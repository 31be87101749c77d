"""Write new things where nobody looks yet, and clear up after the dead.

Everything here is one entry of ``store/tmp`` whose name says whose it is. What is published
leaves it by one rename, so that nothing has to be removed: a file system that has just freed
many inodes takes longer to find the next one.
"""

from __future__ import annotations

import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from storage import _os
from storage.owner import is_dead_mark, own_mark

_ABANDONED_AFTER_S = 24 * 3600.0  # when the owner cannot be asked (another machine's)


@contextmanager
def staging_folder(store: Path) -> Iterator[Path]:
    """Give an empty folder below ``store/tmp``; remove it at the end if it is still there."""
    folder = _place(store)
    _os.active.mkdir(folder)
    try:
        yield folder
    except BaseException:
        # What went wrong is what the caller must hear of; ``sweep`` removes what is left.
        with suppress(OSError):
            _os.remove_tree(folder)
        raise
    _os.remove_tree(folder)


@contextmanager
def staged_file(store: Path, data: bytes) -> Iterator[Path]:
    """Give a file below ``store/tmp``; remove it at the end if it is still there."""
    draft = _place(store)
    try:
        _os.active.write(draft, data)
        yield draft
    except BaseException:
        with suppress(OSError):
            _os.active.unlink(draft)
        raise
    with suppress(FileNotFoundError):
        _os.active.unlink(draft)


def _place(store: Path) -> Path:
    """Return a new name that says whose it is before anything is in it."""
    folder = store / "tmp"
    _os.ensure_folder(folder, durable=False)
    return folder / f"{uuid.uuid4().hex}-{own_mark()}"


def sweep(store: Path) -> int:
    """Remove what belongs to a dead process, or is unknown for a day; return how much."""
    parent = store / "tmp"
    if not parent.is_dir():
        return 0
    swept = 0
    for entry in list(parent.iterdir()):
        if not _abandoned(entry):
            continue
        if entry.is_dir() and not entry.is_symlink():
            _os.remove_tree(entry)
        else:
            with suppress(FileNotFoundError):  # another one sweeps, too
                _os.active.unlink(entry)
        swept += 1
    return swept


def _abandoned(entry: Path) -> bool:
    if is_dead_mark(entry.name.partition("-")[2]):
        return True
    try:
        return time.time() - entry.lstat().st_mtime > _ABANDONED_AFTER_S
    except FileNotFoundError:
        return False
