"""Let Zarr read and write the members of an object instead of files of its own choice.

A chunk that the manifest lists but the disk lacks is corruption, never a fill value.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterable

from zarr.abc.store import (
    ByteRequest,
    OffsetByteRequest,
    RangeByteRequest,
    Store,
    SuffixByteRequest,
)
from zarr.core.buffer import Buffer, BufferPrototype

from storage.members import MemberReader, MemberWriter


class WritingStore(Store):
    """Write-once Zarr store over a ``MemberWriter``; metadata is kept for reading back."""

    supports_writes = True
    supports_deletes = False
    supports_listing = False

    def __init__(self, members: MemberWriter) -> None:
        super().__init__(read_only=False)
        self._members = members
        self._metadata: dict[str, Buffer] = {}

    def __eq__(self, other: object) -> bool:
        return self is other

    __hash__ = object.__hash__

    async def get(
        self, key: str, prototype: BufferPrototype, byte_range: ByteRequest | None = None
    ) -> Buffer | None:
        """Return metadata that was set; nothing else can be there."""
        return self._metadata.get(key)

    async def get_partial_values(
        self,
        prototype: BufferPrototype,
        key_ranges: Iterable[tuple[str, ByteRequest | None]],
    ) -> list[Buffer | None]:
        """Return what ``get`` returns for each key."""
        return [await self.get(key, prototype, byte_range) for key, byte_range in key_ranges]

    async def exists(self, key: str) -> bool:
        """Tell whether a member was written."""
        return key in self._metadata or key in self._members.members

    async def set(self, key: str, value: Buffer) -> None:
        """Keep metadata until ``flush``; write a chunk at once."""
        if key.endswith("zarr.json"):
            self._metadata[key] = value
        else:
            self._members.put(key, value.as_numpy_array().data)

    def flush(self) -> None:
        """Write the final metadata of all but the root, whose attributes are not Zarr's.

        Zarr may set metadata twice; a member is written once.
        """
        for key in sorted(self._metadata):
            if key != "zarr.json":
                self._members.put(key, self._metadata[key].to_bytes())

    async def delete(self, key: str) -> None:
        """Refuse: an object is written once."""
        raise NotImplementedError("members are written once")

    def list(self) -> AsyncIterator[str]:
        """List the metadata keys."""
        return _each(self._metadata)

    def list_prefix(self, prefix: str) -> AsyncIterator[str]:
        """List the metadata keys below ``prefix``."""
        return _each(key for key in self._metadata if key.startswith(prefix))

    def list_dir(self, prefix: str) -> AsyncIterator[str]:
        """List nothing: the writer never asks."""
        return _each(())


class ReadingStore(Store):
    """Verified Zarr store over a ``MemberReader``."""

    supports_writes = False
    supports_deletes = False
    supports_listing = True

    def __init__(self, members: MemberReader) -> None:
        super().__init__(read_only=True)
        self._members = members

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ReadingStore) and other._members.digest == self._members.digest

    def __hash__(self) -> int:
        return hash(self._members.digest)

    async def get(
        self, key: str, prototype: BufferPrototype, byte_range: ByteRequest | None = None
    ) -> Buffer | None:
        """Return a member or a part of it; None if the object never had it."""
        if key not in self._members:
            return None
        if self._members.readers > 1:  # what is far away is waited for elsewhere
            return await asyncio.to_thread(self._get, key, prototype, byte_range)
        return self._get(key, prototype, byte_range)

    def _get(self, key: str, prototype: BufferPrototype, byte_range: ByteRequest | None) -> Buffer:
        if byte_range is None:
            return prototype.buffer.from_bytes(self._members.get(key))
        start, stop = _span(byte_range, self._members.manifest.members[key].size)
        return prototype.buffer.from_bytes(self._members.get_range(key, start, stop))

    async def get_partial_values(
        self,
        prototype: BufferPrototype,
        key_ranges: Iterable[tuple[str, ByteRequest | None]],
    ) -> list[Buffer | None]:
        """Return what ``get`` returns for each key."""
        return [await self.get(key, prototype, byte_range) for key, byte_range in key_ranges]

    async def exists(self, key: str) -> bool:
        """Tell whether the object has the member."""
        return key in self._members

    async def set(self, key: str, value: Buffer) -> None:
        """Refuse: published objects never change."""
        raise NotImplementedError("published objects never change")

    async def delete(self, key: str) -> None:
        """Refuse: published objects never change."""
        raise NotImplementedError("published objects never change")

    def list(self) -> AsyncIterator[str]:
        """List all members."""
        return _each(self._members.manifest.members)

    def list_prefix(self, prefix: str) -> AsyncIterator[str]:
        """List the members below ``prefix``."""
        return _each(key for key in self._members.manifest.members if key.startswith(prefix))

    def list_dir(self, prefix: str) -> AsyncIterator[str]:
        """List the names right below ``prefix``."""
        start = prefix.rstrip("/") + "/" if prefix else ""
        inside = (k for k in self._members.manifest.members if k.startswith(start))
        return _each(dict.fromkeys(key[len(start) :].split("/")[0] for key in inside))


def _span(request: ByteRequest, size: int) -> tuple[int, int]:
    if isinstance(request, RangeByteRequest):
        return request.start, request.end
    if isinstance(request, OffsetByteRequest):
        return request.offset, size
    if isinstance(request, SuffixByteRequest):
        return max(0, size - request.suffix), size
    raise TypeError(f"unknown byte range {request!r}")


async def _each(keys: Iterable[str]) -> AsyncIterator[str]:
    for key in tuple(keys):
        yield key
