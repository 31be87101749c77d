"""Numbered slots that processes of one machine share: locked files, freed with their owners.

A slot is taken by locking its file (``flock``), so that there is no state to repair: a
process that is killed gives back all that it held. Who wants slots queues with a ticket,
a locked file too. Slots are looked at and taken under one gate, all or none, so that no two
wait for each other. Whoever gives slots back rings for those in the queue (named pipes), so
that nobody sleeps beside a free slot.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import json
import os
import select
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

_RINGS = 4096

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
        self._bell: int | None = None
        self._name = f"{time.monotonic_ns():020d}-{uuid.uuid4().hex}"
        (folder / "waiting").mkdir(exist_ok=True)
        (folder / "bells").mkdir(exist_ok=True)

    def try_take(self) -> bool:
        """Take all slots of the request, or none; queue if they are not free."""
        with _gate(self._folder):
            found = self._find()
            if found is None:
                self._enter_queue()
                return False
            self._take(found)
            self._leave_queue()
            return True

    def wait(self, seconds: float) -> None:
        """Wait until somebody gives slots back, but not longer than ``seconds``.

        One whose owner is killed does not ring: try again after a while.
        """
        assert self._bell is not None, "only who is in the queue waits"
        poll = select.poll()
        poll.register(self._bell, select.POLLIN)
        if poll.poll(1000 * seconds):
            os.read(self._bell, _RINGS)

    def give_back(self) -> None:
        """Free the slots, or leave the queue."""
        _close(self._held)
        self._held = []
        with _gate(self._folder):
            self._leave_queue()
            _ring(self._folder / "bells")

    def _find(self) -> dict[str, list[tuple[int, str]]] | None:
        """Lock what is asked for, and as much again as is kept for those who waited long
        enough; None if there is not so much.
        """
        waiting = list(self._waiting_long())
        found: dict[str, list[tuple[int, str]]] = {}
        for kind, count in self._request.items():
            kept = max((other.get(kind, 0) for other in waiting), default=0)
            found[kind] = self._free(kind, count + kept)
            if len(found[kind]) < count + kept:
                _close(descriptor for slots in found.values() for descriptor, _ in slots)
                return None
        return found

    def _free(self, kind: str, most: int) -> list[tuple[int, str]]:
        """Lock free slots of a kind; give their descriptors and names.

        The last ones come first: who has a smaller budget uses only the first ones.
        """
        found: list[tuple[int, str]] = []
        for name in reversed(self._pool[kind]):
            if len(found) == most:
                break
            descriptor = _locked(self._folder / f"{kind}-{name}")
            if descriptor is not None:
                found.append((descriptor, name))
        return found

    def _take(self, found: dict[str, list[tuple[int, str]]]) -> None:
        for kind, slots in found.items():
            taken = slots[: self._request[kind]]
            self._held += [descriptor for descriptor, _ in taken]
            self.slots[kind] = tuple(name for _, name in taken)
            _close(descriptor for descriptor, _ in slots[self._request[kind] :])

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
            bell = self._folder / "bells" / self._name
            os.mkfifo(bell, 0o600)
            self._bell = os.open(bell, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)

    def _leave_queue(self) -> None:
        for folder, descriptor in (("waiting", self._paper), ("bells", self._bell)):
            if descriptor is not None:
                (self._folder / folder / self._name).unlink(missing_ok=True)
                os.close(descriptor)
        self._paper = self._bell = None


def _ring(bells: Path) -> None:
    """Wake all in the queue; remove the bells of the dead. To be called behind the gate."""
    for path in bells.iterdir():
        try:
            descriptor = os.open(path, os.O_WRONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        except OSError as error:
            if error.errno == errno.ENXIO:  # nobody listens any more
                path.unlink(missing_ok=True)
            continue
        with contextlib.suppress(BlockingIOError):  # it has been rung for often enough
            os.write(descriptor, b"!")
        os.close(descriptor)


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
