"""Keep members that were read from a bucket on this machine: every step reads its inputs again.

A member never changes and is named by its digest, so nothing here can be out of date; it is
hashed when it is read, as if it came from the bucket.
"""

from __future__ import annotations

import os
import shutil
import threading
import uuid
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

from storage import _os
from storage.digest import hexadecimal
from storage.errors import StoreFormatError, StoreReadOnly

DEFAULT_GB = 10.0
_KEEP = 0.8  # of the limit, when something has to go


class ReadCache:
    """A folder of members, the least recently read of which go when it is full.

    Many processes may share it. It is a courtesy: when its disk is full, members are not
    kept, and nothing else happens.
    """

    def __init__(self, folder: Path, limit: int) -> None:
        self.folder = folder
        self.limit = limit  # bytes
        self._bytes: int | None = None  # by what this process knows
        self._guard = threading.Lock()

    @classmethod
    def of(cls, environment: Mapping[str, str]) -> ReadCache | None:
        """Return the cache in ``GARDEN_CACHE``, of ``GARDEN_CACHE_GB`` (10); None if not set.

        Raises:
            StoreFormatError: the size is no positive number.
            StoreReadOnly: the folder cannot be made.
        """
        folder = environment.get("GARDEN_CACHE")
        if not folder:
            return None
        try:
            limit = float(environment.get("GARDEN_CACHE_GB") or DEFAULT_GB)
        except ValueError:
            limit = 0.0
        if not 0 < limit < float("inf"):
            raise StoreFormatError("GARDEN_CACHE_GB is no positive number of gigabytes")
        place = Path(folder).expanduser().absolute()
        try:
            _os.ensure_folder(place, durable=False)
        except OSError as error:
            raise StoreReadOnly(
                f"the folder {place} of GARDEN_CACHE cannot be made ({error.strerror}): choose"
                " another, or unset GARDEN_CACHE"
            ) from error
        return cls(place, int(limit * 1e9))

    def get(self, digest: str) -> bytes | None:
        """Return what is kept for a member's digest, unverified; None if nothing is."""
        place = self._place(digest)
        try:
            data = place.read_bytes()
            os.utime(place)
        except OSError:
            return None
        return data

    def put(self, digest: str, data: bytes) -> None:
        """Keep a member."""
        self._keep(digest, len(data), lambda draft: _os.active.write(draft, data))

    def adopt(self, digest: str, file: Path) -> None:
        """Keep a copy of a file that holds a member."""
        self._keep(digest, file.stat().st_size, lambda draft: shutil.copyfile(file, draft))

    def drop(self, digest: str) -> None:
        """Forget a member."""
        with suppress(OSError):
            _os.active.unlink(self._place(digest))

    def _keep(self, digest: str, size: int, write: Callable[[Path], object]) -> None:
        place = self._place(digest)
        if size > self.limit * (1 - _KEEP) or place.exists():
            return
        draft = self.folder / f"{uuid.uuid4().hex}.draft"
        try:
            self._make_room(size)
            write(draft)
            _os.ensure_folder(place.parent, durable=False)
            _os.active.rename(draft, place)
        except OSError:
            with suppress(OSError):
                _os.active.unlink(draft)

    def _make_room(self, size: int) -> None:
        with self._guard:
            if self._bytes is None or self._bytes + size > self.limit:
                self._bytes = self._shrink(int(self.limit * _KEEP) - size)
            self._bytes += size

    def _shrink(self, limit: int) -> int:
        """Remove the longest unread until no more than ``limit`` bytes are left; return these."""
        files = []
        for path in self.folder.rglob("*"):
            with suppress(OSError):
                status = path.stat()
                if path.is_file():
                    files.append((status.st_mtime, status.st_size, path))
        left = sum(size for _time, size, _path in files)
        for _time, size, path in sorted(files):
            if left <= limit:
                break
            with suppress(OSError):
                _os.active.unlink(path)
            left -= size
        return left

    def _place(self, digest: str) -> Path:
        name = hexadecimal(digest)
        return self.folder / name[:2] / name[2:]
