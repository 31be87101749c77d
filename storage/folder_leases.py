"""Keep leases as files of a store's folder, created by link.

A lease that stands is changed under one advisory lock, held for microseconds, that the
system drops with its owner.
"""

from __future__ import annotations

from contextlib import AbstractContextManager, suppress
from pathlib import Path

from storage import _os, locks
from storage.leases import LEASE_S, Accepts, Lease, LeaseTable, lease_name
from storage.staging import staged_file


class FolderLeases(LeaseTable):
    """The leases of a store in a folder."""

    def __init__(self, store: Path, seconds: float = LEASE_S) -> None:
        super().__init__(seconds)
        self._store = store

    def _create(self, lease: Lease) -> bool:
        _os.ensure_folder(self._store / "leases", durable=False)
        with staged_file(self._store, lease.to_bytes()) as draft:
            try:
                _os.active.link(draft, self._store / lease_name(lease.key))
            except FileExistsError:
                return False
        return True

    def _exchange(self, key: str, accepts: Accepts, new: Lease | None) -> bool:
        place = self._store / lease_name(key)
        with self._locked():
            current = self._read(key)
            if not accepts(current):
                return False
            if new is not None:
                with staged_file(self._store, new.to_bytes()) as draft:
                    _os.active.rename(draft, place)
            else:
                with suppress(FileNotFoundError):
                    _os.active.unlink(place)
            return True

    def _read(self, key: str) -> Lease | None:
        try:
            return Lease.from_bytes((self._store / lease_name(key)).read_bytes())
        except (FileNotFoundError, ValueError):
            return None

    def _locked(self) -> AbstractContextManager[None]:
        folder = self._store / "leases"
        _os.ensure_folder(folder, durable=False)
        return locks.alone(folder / "lock")
