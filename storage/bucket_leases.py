"""Keep leases in a bucket: created where there is none, changed only as they were last seen.

A lease ends by its owner's clock. A live owner renews it at a third of its term, so that two
machines may differ by two thirds of the term (40 s of 60) before one takes over from a live
other; then both compute, and the first result counts.
"""

from __future__ import annotations

import dataclasses
import time
from typing import NamedTuple

from storage.bucket_address import RETRY_TIMEOUT_S
from storage.bucket_client import BucketClient, Version
from storage.leases import LEASE_S, Accepts, Lease, LeaseTable, lease_name

_TRIES = 4


class _Seen(NamedTuple):
    lease: Lease | None  # None if it cannot be read
    version: Version


class BucketLeases(LeaseTable):
    """The leases of a store in a bucket."""

    def __init__(self, bucket: BucketClient, seconds: float = LEASE_S) -> None:
        super().__init__(seconds)
        self._bucket = bucket
        self._seen: dict[str, _Seen] = {}  # of what this process holds

    def _create(self, lease: Lease) -> bool:
        version = self._bucket.create(lease_name(lease.key), lease.to_bytes())
        if version is None:
            return False
        self._seen[lease.key] = _Seen(lease, version)
        return True

    def _exchange(self, key: str, accepts: Accepts, new: Lease | None) -> bool:
        seen = self._seen.pop(key, None)
        if seen is None or not accepts(seen.lease):
            seen = self._look(key)
        for _try in range(_TRIES):
            if not accepts(None if seen is None else seen.lease):
                return False
            if self._replace(key, seen, new):
                return True
            seen = self._look(key)
        return False

    def _replace(self, key: str, seen: _Seen | None, new: Lease | None) -> bool:
        if new is not None and seen is None:
            return self._create(new)
        if new is not None and seen is not None:
            version = self._bucket.update(lease_name(key), new.to_bytes(), seen.version)
            if version is not None:
                self._seen[key] = _Seen(new, version)
            return version is not None
        return seen is None or self._give_back(key, seen)

    def _give_back(self, key: str, seen: _Seen) -> bool:
        """Remove a lease, which has no condition: only while nobody else may touch it.

        Later it is marked as ended, under the condition that it is still the one seen.
        """
        held = seen.lease
        if held is not None and held.expires_at - time.time() > RETRY_TIMEOUT_S:
            self._bucket.delete([lease_name(key)])
            return True
        if held is None or held.expires_at == 0.0:
            return True
        ended = dataclasses.replace(held, token="", expires_at=0.0)
        return self._bucket.update(lease_name(key), ended.to_bytes(), seen.version) is not None

    def _read(self, key: str) -> Lease | None:
        seen = self._look(key)
        return None if seen is None else seen.lease

    def _look(self, key: str) -> _Seen | None:
        try:
            data, version = self._bucket.get_version(lease_name(key))
        except FileNotFoundError:
            return None
        try:
            return _Seen(Lease.from_bytes(data), version)
        except ValueError:
            return _Seen(None, version)
