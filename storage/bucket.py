"""Carry a store in a bucket of an S3-compatible server with conditional puts.

A bucket has no rename: the members of an object are written first and its manifest last,
where there is none, so that the manifest is the moment of publication. Members without a
manifest are no object; ``sweep`` removes them when they are a day old.
"""

from __future__ import annotations

import errno
import os
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path

from blake3 import blake3

from storage import bucket_sweep, workroom
from storage.bucket_address import BucketAddress
from storage.bucket_client import BucketClient
from storage.bucket_leases import BucketLeases
from storage.digest import PREFIX, digest_bytes, hexadecimal
from storage.errors import StoreError, StoreFormatError, StoreFull, StoreReadOnly
from storage.leases import LEASE_S
from storage.manifest import MANIFEST
from storage.medium import Level
from storage.members import MemberWriter
from storage.object_names import object_prefix, sealed_by
from storage.read_cache import ReadCache

_REQUESTS_AT_ONCE = 8
_REFRESH_AFTER_S = 3600.0
_SEALING_TRIES = 3
_COLLECTING = digest_bytes(b"garden.collecting/1")
_POLL_S = 1.0


class BucketMedium:
    """A store's bucket. See ``Medium`` for what the methods promise."""

    recheck: Level = "manifest"
    readers = _REQUESTS_AT_ONCE

    def __init__(self, address: BucketAddress, *, lease_s: float = LEASE_S) -> None:
        self.address = str(address)
        self._bucket = BucketClient(address)
        self.leases = BucketLeases(self._bucket, lease_s)
        self._touched: dict[str, float] = {}
        self.cache = ReadCache.of(os.environ)

    def prepare(self) -> None:
        """Check that there is a bucket, and nothing but a store in the place.

        Raises:
            StoreMissing: there is no such bucket.
            StoreFormatError: the place holds something else.
        """
        for entry in self._bucket.list(""):
            raise StoreFormatError(
                f"{self.address} holds {entry.name} and is no store: choose an empty prefix"
            )

    # -- documents ------------------------------------------------------------------------

    def read(self, name: str) -> bytes | None:
        """Return a document, None if there is none."""
        try:
            return self._bucket.get(name)
        except FileNotFoundError:
            return None

    def create(self, name: str, data: bytes) -> bool:
        """Make a durable document at once; False if the name is taken."""
        return self._bucket.create(name, data) is not None

    def replace(self, name: str, data: bytes) -> None:
        """Make or change a document at once."""
        self._bucket.put(name, data)

    def delete(self, *names: str) -> None:
        """Remove documents."""
        self._bucket.delete(list(names))

    def clear(self, prefix: str) -> None:
        """Remove all documents below a folder."""
        self._bucket.delete(list(self.names(prefix)))

    def touch(self, name: str) -> None:
        """Make an empty document, or make it young again if it is older than an hour.

        At most one request an hour and name in a process that finds it young.
        """
        now = time.time()
        if now - self._touched.get(name, 0.0) < _REFRESH_AFTER_S:
            return
        self._touched[name] = now
        try:
            if now - self._bucket.head(name).modified < _REFRESH_AFTER_S:
                return
        except FileNotFoundError:
            pass
        except OSError:
            return
        with suppress(OSError):
            self._bucket.put(name, b"")

    def names(self, prefix: str) -> Iterator[str]:
        """Give the name of every document below a folder, sorted."""
        for entry in self._bucket.list(prefix):
            yield entry.name

    def times(self, prefix: str) -> Iterator[tuple[str, float]]:
        """Give what ``names`` gives, and when each was last written, by the server's clock."""
        for entry in self._bucket.list(prefix):
            yield entry.name, entry.modified

    # -- objects --------------------------------------------------------------------------

    @contextmanager
    def stage(self) -> Iterator[MemberWriter]:
        """Give a place for an object's members, on this machine."""
        with workroom.folder() as staged:
            yield MemberWriter(staged, durable=False)

    def seal(self, staged: MemberWriter, digest: str, manifest: bytes) -> bool:
        """Upload the members, then the manifest; False if somebody else has published it."""
        place = object_prefix(digest)
        self._upload(staged, place, list(staged.members))
        created = self._bucket.create(place + MANIFEST, manifest) is not None
        for _try in range(_SEALING_TRIES):
            if not (lost := self._lost(staged, digest)):
                self._keep_here(staged)
                return created
            self._upload(staged, place, lost)  # removed as abandoned just before the manifest came
        raise OSError(errno.EIO, f"members of {digest[:15]} in {self.address} keep being removed")

    def _upload(self, staged: MemberWriter, place: str, paths: list[str]) -> None:
        def put(path: str) -> None:
            self._bucket.put(place + path, staged.folder / path)

        with ThreadPoolExecutor(_REQUESTS_AT_ONCE, "upload") as pool:
            list(pool.map(put, paths))

    def _keep_here(self, staged: MemberWriter) -> None:
        if self.cache is not None:
            for path, member in staged.members.items():
                self.cache.adopt(member.digest, staged.folder / path)

    def _lost(self, staged: MemberWriter, digest: str) -> list[str]:
        present = self.members(digest)
        return [p for p, member in staged.members.items() if present.get(p) != member.size]

    def refresh(self, digest: str, manifest: bytes) -> None:
        """Make an object that is published again as young as a new one.

        A collector leaves young objects alone, and this one gets its action only now.
        """
        if time.time() - self.published_at(digest) > _REFRESH_AFTER_S:
            self._bucket.put(object_prefix(digest) + MANIFEST, manifest)

    def objects(self) -> Iterator[str]:
        """Give the digest of every object that has a manifest, sorted."""
        for entry in self._bucket.list("objects/b3/"):
            if (digest := sealed_by(entry.name)) is not None:
                yield digest

    def members(self, digest: str) -> dict[str, int]:
        """Return the files of an object and their bytes, in one request for a thousand."""
        place = object_prefix(digest)
        sizes = {entry.name.removeprefix(place): entry.size for entry in self._bucket.list(place)}
        return sizes if MANIFEST in sizes else {}

    def read_member(self, digest: str, path: str, start: int = 0, stop: int | None = None) -> bytes:
        """Return the bytes ``start:stop`` of a file of an object."""
        return self._bucket.get(object_prefix(digest) + path, start, stop)

    def member_digest(self, digest: str, path: str) -> str:
        """Return the digest of a file of an object, read piece by piece."""
        hasher = blake3()
        for piece in self._bucket.stream(object_prefix(digest) + path):
            hasher.update(piece)
        return PREFIX + hasher.hexdigest()

    def published_at(self, digest: str) -> float:
        """Return when an object was published, by the server's clock."""
        return self._bucket.head(object_prefix(digest) + MANIFEST).modified

    def quarantine(self, digest: str) -> bool:
        """Copy a damaged object for autopsy and take its manifest away.

        Its members stay until they are written over or swept: a writer may be at them.
        """
        place = object_prefix(digest)
        ward = f"quarantine/{hexadecimal(digest)}-{time.time_ns()}/"
        paths = list(self.members(digest))
        if not paths:
            return False

        def copy(path: str) -> None:
            self._bucket.copy(place + path, ward + path)

        with ThreadPoolExecutor(_REQUESTS_AT_ONCE, "quarantine") as pool:
            list(pool.map(copy, paths))
        self._bucket.delete([place + MANIFEST])
        return True

    def remove(self, *digests: str) -> None:
        """Remove objects: their manifests first."""
        places = [object_prefix(digest) for digest in digests]
        self._bucket.delete([place + MANIFEST for place in places])
        for place in places:
            rest = [entry.name for entry in self._bucket.list(place)]
            if place + MANIFEST not in rest:
                self._bucket.delete(rest)

    # -- room and order -------------------------------------------------------------------

    @contextmanager
    def publishing(self) -> Iterator[None]:
        """Let names be made: a collector leaves alone what is young."""
        yield

    @contextmanager
    def collecting(self) -> Iterator[None]:
        """Be the only collector."""
        while (lease := self.leases.try_acquire(_COLLECTING)) is None:
            time.sleep(_POLL_S)
        try:
            yield
        finally:
            self.leases.release(lease)

    @contextmanager
    def scratch(self) -> Iterator[Path]:
        """Give a folder in this machine's temporary folder."""
        with workroom.folder() as place:
            yield place

    def sweep(self) -> int:
        """Remove members that have had no manifest for a day, and leases that ended then."""
        return workroom.sweep() + bucket_sweep.sweep(self._bucket)

    def explain(self, error: OSError) -> StoreError | None:
        """Return the store's own error for a full or read-only place."""
        if error.errno == errno.ENOSPC and error.filename != self.address:
            return workroom.full()
        if error.errno == errno.ENOSPC:
            return StoreFull(
                f"the store {self.address} is full ({error.strerror}): run `garden store gc`,"
                " raise its quota, or choose another store with --store"
            )
        if error.errno == errno.EACCES:
            return StoreReadOnly(
                f"the store {self.address} cannot be written: {error.strerror}; check what the"
                " credentials may do (PutObject, DeleteObject) or choose another store with --store"
            )
        return None
