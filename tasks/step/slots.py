"""Numbered slots that processes of one machine share: locked files, freed with their owners.

A slot is taken by locking its file (``flock``), so that there is no state to repair: a
process that is killed gives back all that it held. Who wants slots queues with a ticket,
a locked file too. Slots are looked at and taken under one gate, all or none, so that no two
wait for each other.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import stat
import tempfile
import time
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from garden_models.scene import BadInput

PATIENCE_S = 20.0
"""How long smaller requests may overtake a larger one; then slots are kept for it."""

Request = Mapping[str, int]
"""How many slots of each kind."""

Pool = Mapping[str, tuple[str, ...]]
"""The names of the slots of each kind that a request may be served from."""


def runtime_folder() -> Path:
    """Return the user's own folder for slots, in the system's temporary folder.

    Raises BadInput if somebody else made it.
    """
    folder = Path(tempfile.gettempdir()) / f"garden-slots-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or found.st_mode & 0o022:
        raise BadInput(f"{folder} is not a folder of yours alone: remove it")
    return folder


class Ticket:
    """A place in the queue, and the slots once they are taken."""

    def __init__(self, folder: Path, request: Request, pool: Pool) -> None:
        self._folder = folder
        self._request = {kind: count for kind, count in request.items() if count > 0}
        self._pool = pool
        self._held: list[int] = []
        self.slots: dict[str, tuple[str, ...]] = {}
        self._paper: int | None = None
        self._name = f"{time.monotonic_ns():020d}-{uuid.uuid4().hex}"
        (folder / "waiting").mkdir(exist_ok=True)

    def try_take(self) -> bool:
        """Take all slots of the request, or none; queue if they are not free."""
        with _gate(self._folder):
            free = {kind: self._free(kind) for kind in self._request}
            if all(len(free[k]) >= n for k, n in self._request.items()) and self._may_go(free):
                self._take(free)
                self._leave_queue()
                return True
            _close(descriptor for found in free.values() for descriptor, _ in found)
            self._enter_queue()
        return False

    def give_back(self) -> None:
        """Free the slots, or leave the queue."""
        _close(self._held)
        self._held = []
        self._leave_queue()

    def _free(self, kind: str) -> list[tuple[int, str]]:
        """Lock all free slots of a kind; give their descriptors and names.

        The last ones come first: who has a smaller budget uses only the first ones.
        """
        found = []
        for name in reversed(self._pool[kind]):
            descriptor = _locked(self._folder / f"{kind}-{name}")
            if descriptor is not None:
                found.append((descriptor, name))
        return found

    def _take(self, free: dict[str, list[tuple[int, str]]]) -> None:
        for kind, found in free.items():
            taken = found[: self._request[kind]]
            self._held += [descriptor for descriptor, _ in taken]
            self.slots[kind] = tuple(name for _, name in taken)
            _close(descriptor for descriptor, _ in found[self._request[kind] :])

    def _may_go(self, free: dict[str, list[tuple[int, str]]]) -> bool:
        """Tell whether this would not keep slots from somebody who waited long enough."""
        for other in self._waiting_long():
            for kind, count in self._request.items():
                if len(free[kind]) - count < other.get(kind, 0):
                    return False
        return True

    def _waiting_long(self) -> Iterator[Request]:
        """Give the requests that came before this one and lost their patience."""
        now = time.monotonic_ns()
        for path in sorted((self._folder / "waiting").iterdir()):
            if path.name >= self._name:
                return
            descriptor = _locked(path, create=False)
            if descriptor is not None:  # its owner died
                path.unlink(missing_ok=True)
                os.close(descriptor)
            elif now - int(path.name.partition("-")[0]) > PATIENCE_S * 1e9:
                with contextlib.suppress(OSError, ValueError):
                    yield json.loads(path.read_bytes())

    def _enter_queue(self) -> None:
        if self._paper is None:
            path = self._folder / "waiting" / self._name
            self._paper = _locked(path)
            path.write_text(json.dumps(self._request))

    def _leave_queue(self) -> None:
        if self._paper is not None:
            (self._folder / "waiting" / self._name).unlink(missing_ok=True)
            os.close(self._paper)
            self._paper = None


@contextmanager
def _gate(folder: Path) -> Iterator[None]:
    """Be the only one on this machine that looks at slots; nobody stays here for long."""
    descriptor = os.open(folder / "gate", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        os.utime(descriptor)  # old files in temporary folders are cleaned away
        yield
    finally:
        os.close(descriptor)


def _locked(path: Path, *, create: bool = True) -> int | None:
    """Return a descriptor that holds the file's lock, None if somebody else does."""
    flags = os.O_RDWR | os.O_CLOEXEC | (os.O_CREAT if create else 0)
    try:
        descriptor = os.open(path, flags, 0o600)
    except FileNotFoundError:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        return None
    os.utime(descriptor)
    return descriptor


def _close(descriptors: Iterator[int] | list[int]) -> None:
    for descriptor in descriptors:
        # A child that was forked a moment ago may hold a copy: closing alone would not do.
        fcntl.flock(descriptor, fcntl.LOCK_UN)
        os.close(descriptor)
