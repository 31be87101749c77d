"""Write and read the files of one object, each checked against its manifest."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

from storage import _os
from storage.digest import digest_bytes
from storage.errors import CorruptArtifact
from storage.manifest import Manifest, Member

if TYPE_CHECKING:
    from storage.medium import Medium

_SYNCING_THREADS = 8
_SMALL = 64 << 10  # bytes; such a member is read again and again: it says where the others lie


class MemberWriter:
    """Collect the members of an object in a staging folder (thread-safe)."""

    def __init__(self, folder: Path, *, durable: bool) -> None:
        self.folder = folder
        self._durable = durable
        self.members: dict[str, Member] = {}
        self._guard = threading.Lock()

    def put(self, path: str, data: bytes | memoryview) -> None:
        """Write one member, once."""
        target = self.folder / path
        _os.ensure_folder(target.parent, durable=False)
        _os.active.write(target, data)
        member = Member(memoryview(data).nbytes, digest_bytes(data))
        with self._guard:
            self.members[path] = member

    def sync(self) -> None:
        """Make all members durable; at once, since the disk then waits only once for many."""
        if not self._durable:
            return
        paths = [self.folder / path for path in self.members]
        with ThreadPoolExecutor(_SYNCING_THREADS, "fsync") as pool:
            list(pool.map(_os.active.fsync, paths))


class MemberReader:
    """Read the members of a published object; what differs from the manifest raises."""

    def __init__(self, medium: Medium, digest: str, manifest: Manifest) -> None:
        self.digest = digest
        self.manifest = manifest
        self._medium = medium
        self._hashed: set[str] = set()
        self._ahead: dict[str, bytes] = {}

    def __contains__(self, path: str) -> bool:
        return path in self.manifest.members

    @property
    def readers(self) -> int:
        """How many members are best read at once."""
        return self._medium.readers

    def read_ahead(self) -> None:
        """Read all members now, at once, where that saves waiting; each is kept for ``get``.

        Raises:
            CorruptArtifact: one of them is missing or has changed.
        """
        if self.readers < 2:
            return
        waiting = [path for path in self.manifest.members if path not in self._ahead]
        with ThreadPoolExecutor(self.readers, "read") as pool:
            self._ahead |= zip(waiting, pool.map(self.get, waiting), strict=True)

    def get(self, path: str) -> bytes:
        """Return a whole member, hashed against the manifest.

        Raises:
            CorruptArtifact: it is missing or has changed.
        """
        member = self.manifest.members.get(path)
        if member is None:
            raise CorruptArtifact(self.digest, f"{path} is no member")
        if path in self._ahead:
            return self._ahead[path] if member.size < _SMALL else self._ahead.pop(path)
        data = self._cached(member)
        if data is None:
            data = self._read(path, 0, None)
            if not _is(member, data):
                raise CorruptArtifact(self.digest, f"member {path} has changed")
            if self._medium.cache is not None:
                self._medium.cache.put(member.digest, data)
        self._hashed.add(path)
        if self.readers > 1 and member.size < _SMALL:
            self._ahead[path] = data
        return data

    def _cached(self, member: Member) -> bytes | None:
        """Return a member that is kept on this machine, hashed as if it came from afar."""
        cache = self._medium.cache
        data = None if cache is None else cache.get(member.digest)
        if cache is not None and data is not None and not _is(member, data):
            cache.drop(member.digest)
            return None
        return data

    def check_rest(self) -> None:
        """Hash the members that were not read whole so far.

        Raises:
            CorruptArtifact: one of them is missing or has changed.
        """
        for path in self.manifest.members.keys() - self._hashed:
            self.get(path)

    def get_range(self, path: str, start: int, stop: int) -> bytes:
        """Return the bytes ``start:stop`` of a member, whose own checksums must hold them.

        Raises:
            CorruptArtifact: the member is missing or shorter than the manifest says.
        """
        member = self.manifest.members[path]
        stop = min(stop, member.size)
        if path in self._ahead:
            return self._ahead[path][start:stop]
        data = self._read(path, start, stop)
        if len(data) != stop - start:
            raise CorruptArtifact(self.digest, f"member {path} is too short")
        return data

    def _read(self, path: str, start: int, stop: int | None) -> bytes:
        try:
            return self._medium.read_member(self.digest, path, start, stop)
        except (ConnectionError, TimeoutError):
            raise
        except OSError as error:
            raise CorruptArtifact(self.digest, f"member {path} cannot be read") from error


def _is(member: Member, data: bytes) -> bool:
    return len(data) == member.size and digest_bytes(data) == member.digest
