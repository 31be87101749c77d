"""Write new things where nobody looks yet, and clear up after the dead."""

from __future__ import annotations

import dataclasses
import json
import os
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from storage import _os
from storage.owner import Owner, is_dead_mark, own_mark

OWNER_FILE = "owner.json"
_ABANDONED_AFTER_S = 24 * 3600.0  # when the owner cannot be asked (another machine's)


@contextmanager
def staging_folder(store: Path, *, durable: bool) -> Iterator[Path]:
    """Give an empty folder below ``store/tmp``, marked with its owner; remove it at the end."""
    parent = store / "tmp"
    _os.ensure_folder(parent, durable=durable)
    outer = parent / own_name()
    _os.active.mkdir(outer)
    try:
        owner = json.dumps(dataclasses.asdict(Owner.here())).encode()
        _os.active.write(outer / OWNER_FILE, owner)
        inner = outer / "stage"
        _os.active.mkdir(inner)
        yield inner
    except BaseException:
        # What went wrong is what the caller must hear of; ``sweep`` removes what is left.
        with suppress(OSError):
            _os.remove_tree(outer)
        raise
    _os.remove_tree(outer)


def own_name() -> str:
    """Return a new name that says whose it is before anything is in it."""
    return f"{uuid.uuid4().hex}-{own_mark()}"


def sweep(store: Path) -> int:
    """Remove staging folders whose owner is dead or unknown for a day; return how many."""
    parent = store / "tmp"
    if not parent.is_dir():
        return 0
    swept = 0
    for entry in os.scandir(parent):
        if not _abandoned(Path(entry.path)):
            continue
        if entry.is_dir(follow_symlinks=False):
            _os.remove_tree(Path(entry.path))
        else:
            with suppress(FileNotFoundError):  # another one sweeps, too
                _os.active.unlink(Path(entry.path))
        swept += 1
    return swept


def _abandoned(folder: Path) -> bool:
    if is_dead_mark(folder.stem.partition("-")[2]):
        return True
    try:
        owner = Owner(**json.loads((folder / OWNER_FILE).read_bytes()))
    except (OSError, ValueError, TypeError):
        owner = None
    if owner is not None and owner.is_dead():
        return True
    try:
        return time.time() - folder.stat().st_mtime > _ABANDONED_AFTER_S
    except FileNotFoundError:
        return False
