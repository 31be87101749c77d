"""Let one worker at a time do an action, and let the others take over when it dies.

A lease names its owner and when it ends; a thread renews it while the work goes on. It is
void when it has ended or when its owner is surely dead (invariant LOCKS-DIE-WITH-OWNERS).
"""

from __future__ import annotations

import dataclasses
import json
import threading
import time
import uuid
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

from storage.digest import hexadecimal, is_digest
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


Accepts = Callable[[Lease | None], bool]


class LeaseTable(ABC):
    """The leases of one store, and those that this process holds and renews."""

    def __init__(self, seconds: float = LEASE_S) -> None:
        self.seconds = seconds
        self._held: dict[str, Lease] = {}
        self._guard = threading.Lock()
        self._renewer: threading.Thread | None = None

    @abstractmethod
    def _create(self, lease: Lease) -> bool:
        """Write a lease where there is none; False if there is one."""

    @abstractmethod
    def _exchange(self, key: str, accepts: Accepts, new: Lease | None) -> bool:
        """In one step: if ``accepts`` what stands there, put ``new`` in its place, or nothing.

        A lease that cannot be read counts as none.
        """

    @abstractmethod
    def _read(self, key: str) -> Lease | None:
        """Return the lease for ``key``, valid or not; None if there is none."""

    def try_acquire(self, key: str) -> Lease | None:
        """Return a lease for ``key``, or None while somebody else holds it."""
        lease = Lease(key, uuid.uuid4().hex, Owner.here(), time.time() + self.seconds)
        if not (self._create(lease) or self._exchange(key, _is_free, lease)):
            return None
        with self._guard:
            self._held[key] = lease
            self._start_renewer()
        return lease

    def release(self, lease: Lease) -> None:
        """Give a lease back; nothing happens if it was taken over meanwhile."""
        with self._guard:
            self._held.pop(lease.key, None)
        self._exchange(lease.key, _is(lease), None)

    def abandon_all(self) -> None:
        """Stop renewing what this table holds; the leases end by themselves."""
        with self._guard:
            self._held.clear()

    def holder(self, key: str) -> Lease | None:
        """Return the valid lease for ``key``, if any."""
        lease = self._read(key)
        return None if lease is None or lease.is_void() else lease

    def drop_void(self, key: str) -> bool:
        """Remove the lease for ``key`` if it is void or unreadable; tell whether it is gone."""
        return self._exchange(key, _is_free, None)

    def _start_renewer(self) -> None:
        if self._renewer is None or not self._renewer.is_alive():
            self._renewer = threading.Thread(target=self._renew, name="leases", daemon=True)
            self._renewer.start()

    def _renew(self) -> None:
        while True:
            time.sleep(self.seconds / 3)
            with self._guard:
                held = list(self._held.values())
                if not held:
                    self._renewer = None
                    return
            for lease in held:
                longer = dataclasses.replace(lease, expires_at=time.time() + self.seconds)
                try:
                    self._exchange(lease.key, _is(lease), longer)
                except OSError:
                    continue  # the next renewal tries again; at worst the lease ends


def lease_name(key: str) -> str:
    """Return the name of the document that holds the lease for ``key``."""
    return f"leases/{hexadecimal(key)}.json"


def leased_key(name: str) -> str | None:
    """Return the key of a lease's document, None if the document is none."""
    digits = name.removeprefix("leases/").removesuffix(".json")
    return f"b3:{digits}" if is_digest(f"b3:{digits}") else None


def _is_free(current: Lease | None) -> bool:
    return current is None or current.is_void()


def _is(lease: Lease) -> Accepts:
    return lambda current: current is not None and current.token == lease.token
