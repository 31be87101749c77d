"""Let one worker at a time do an action, and let the others take over when it dies.

A lease is a file created by link. It names its owner and when it ends; a thread renews it
while the work goes on. A lease is void when it has ended or when its owner is surely dead
(invariant LOCKS-DIE-WITH-OWNERS). Changes to an existing lease are made under one
advisory lock, held for microseconds, that the system drops with its owner.
"""

from __future__ import annotations

import dataclasses
import fcntl
import json
import os
import threading
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from storage import _os
from storage.digest import hexadecimal
from storage.owner import Owner

LEASE_S = 60.0


@dataclass(frozen=True)
class Lease:
    """The right of one process to do one action until ``expires_at`` (Unix seconds)."""

    key: str
    token: str
    owner: Owner
    expires_at: float

    def to_bytes(self) -> bytes:
        """Return the lease as JSON."""
        return json.dumps(dataclasses.asdict(self), sort_keys=True).encode()

    @classmethod
    def from_bytes(cls, data: bytes) -> Lease:
        """Read a lease; ValueError if it is none."""
        try:
            document = json.loads(data)
            owner = Owner(**document["owner"])
            return cls(document["key"], document["token"], owner, float(document["expires_at"]))
        except (KeyError, TypeError) as error:
            raise ValueError(f"no lease: {error}") from error

    def is_void(self) -> bool:
        """Tell whether others may take the lease over."""
        return time.time() >= self.expires_at or self.owner.is_dead()


class LeaseTable:
    """The leases of one store, and those that this process holds."""

    def __init__(self, store: Path, seconds: float = LEASE_S) -> None:
        self._folder = store / "leases"
        self._seconds = seconds
        self._held: dict[str, Lease] = {}
        self._guard = threading.Lock()
        self._renewer: threading.Thread | None = None

    def try_acquire(self, key: str) -> Lease | None:
        """Return a lease for ``key``, or None while somebody else holds it."""
        _os.ensure_folder(self._folder, durable=False)
        lease = Lease(key, uuid.uuid4().hex, Owner.here(), time.time() + self._seconds)
        if self._create(lease) or self._replace_void(lease):
            with self._guard:
                self._held[key] = lease
                self._start_renewer()
            return lease
        return None

    def release(self, lease: Lease) -> None:
        """Give a lease back; nothing happens if it was taken over meanwhile."""
        with self._guard:
            self._held.pop(lease.key, None)
        with self._locked():
            current = self._read(lease.key)
            if current is not None and current.token == lease.token:
                _os.active.unlink(self._path(lease.key))

    def abandon_all(self) -> None:
        """Stop renewing what this table holds; the leases end by themselves."""
        with self._guard:
            self._held.clear()

    def holder(self, key: str) -> Lease | None:
        """Return the valid lease for ``key``, if any."""
        lease = self._read(key)
        return None if lease is None or lease.is_void() else lease

    def _path(self, key: str) -> Path:
        return self._folder / f"{hexadecimal(key)}.json"

    def _read(self, key: str) -> Lease | None:
        try:
            return Lease.from_bytes(self._path(key).read_bytes())
        except (FileNotFoundError, ValueError):
            return None

    def _create(self, lease: Lease) -> bool:
        draft = self._draft(lease)
        try:
            _os.active.link(draft, self._path(lease.key))
        except FileExistsError:
            return False
        finally:
            _os.active.unlink(draft)
        return True

    def _replace_void(self, lease: Lease) -> bool:
        with self._locked():
            current = self._read(lease.key)
            if current is not None and not current.is_void():
                return False
            _os.active.rename(self._draft(lease), self._path(lease.key))
            return True

    def _draft(self, lease: Lease) -> Path:
        drafts = self._folder.parent / "tmp"
        _os.ensure_folder(drafts, durable=False)
        draft = drafts / f"{lease.token}-{uuid.uuid4().hex}.lease"
        _os.active.write(draft, lease.to_bytes())
        return draft

    @contextmanager
    def _locked(self) -> Iterator[None]:
        descriptor = os.open(self._folder / "lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX)
            yield
        finally:
            os.close(descriptor)

    def _start_renewer(self) -> None:
        if self._renewer is None or not self._renewer.is_alive():
            self._renewer = threading.Thread(target=self._renew, name="leases", daemon=True)
            self._renewer.start()

    def _renew(self) -> None:
        while True:
            time.sleep(self._seconds / 3)
            with self._guard:
                held = list(self._held.values())
                if not held:
                    self._renewer = None
                    return
            for lease in held:
                self._extend(lease)

    def _extend(self, lease: Lease) -> None:
        with self._locked():
            current = self._read(lease.key)
            if current is None or current.token != lease.token:
                return
            try:
                longer = dataclasses.replace(lease, expires_at=time.time() + self._seconds)
                _os.active.rename(self._draft(longer), self._path(lease.key))
            except OSError:
                return  # the next renewal tries again; at worst the lease ends
