"""Make single requests to a bucket: each takes effect at once or not at all."""

from __future__ import annotations

import uuid
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from storage.bucket_address import BucketAddress, connect
from storage.bucket_errors import translated

if TYPE_CHECKING:
    from obstore import UpdateVersion

PART_BYTES = 8 << 20
_PARTS_AT_ONCE = 4
_PAGE = 1000
_TRIES = 4
_WRITER = "garden-writer"


@dataclass(frozen=True)
class Entry:
    """A name in a bucket."""

    name: str
    size: int  # bytes
    modified: float  # Unix seconds of the server's clock


@dataclass(frozen=True)
class Version:
    """What stood under a name when it was read or written, for a change of just that."""

    tag: str

    @classmethod
    def of(cls, answer: Any) -> Version:
        """Return the version in a client's answer."""
        return cls(answer["e_tag"])

    def condition(self) -> UpdateVersion:
        """Return it as the client wants it."""
        return {"e_tag": self.tag}


class BucketClient:
    """The requests of one store. Names are relative to the store's prefix. Thread-safe.

    Raises what ``bucket_errors.translated`` says.
    """

    def __init__(self, address: BucketAddress) -> None:
        self.address = str(address)
        self._store = connect(address)

    def get(self, name: str, start: int = 0, stop: int | None = None) -> bytes:
        """Return the bytes ``start:stop`` under a name, fewer if there are not as many."""
        if stop is not None and stop <= start:
            return b""
        options: Any = {}
        if start or stop is not None:
            options = {"range": (start, stop) if stop is not None else {"offset": start}}
        with translated(self.address, "read", name):
            try:
                return bytes(self._store.get(name, options=options).bytes())
            except Exception as error:
                if options and "InvalidRange" in str(error):
                    return b""
                raise

    def get_version(self, name: str) -> tuple[bytes, Version]:
        """Return what is under a name, and its version."""
        with translated(self.address, "read", name):
            answer = self._store.get(name)
            return bytes(answer.bytes()), Version.of(answer.meta)

    def stream(self, name: str) -> Iterator[memoryview]:
        """Give what is under a name in pieces."""
        with translated(self.address, "read", name):
            for piece in self._store.get(name).stream(min_chunk_size=PART_BYTES):
                yield memoryview(piece)

    def head(self, name: str) -> Entry:
        """Return size and time of what is under a name."""
        with translated(self.address, "read", name):
            meta = self._store.head(name)
        return Entry(name, meta["size"], meta["last_modified"].timestamp())

    def put(self, name: str, data: bytes | Path) -> None:
        """Write, or write over; a large file goes in parts."""
        with translated(self.address, "write", name):
            self._store.put(name, data, chunk_size=PART_BYTES, max_concurrency=_PARTS_AT_ONCE)

    def create(self, name: str, data: bytes) -> Version | None:
        """Write where there is nothing, and return the version; None if the name is taken."""
        return self._conditional(name, data, "create")

    def update(self, name: str, data: bytes, version: Version) -> Version | None:
        """Write over just this version, and return the new one; None if it is another now."""
        return self._conditional(name, data, version.condition())

    def _conditional(self, name: str, data: bytes, mode: Any) -> Version | None:
        """Put under a condition.

        An answer may be lost after the write counted, so that the next try finds its own
        work in the way; a server may also refuse two writers at once without keeping either
        (409). What stands there therefore says who wrote it.
        """
        from obstore.exceptions import AlreadyExistsError, PreconditionError

        writer = uuid.uuid4().hex
        for tried in range(_TRIES):
            try:
                with translated(self.address, "write", name):
                    try:
                        put = self._store.put(name, data, attributes={_WRITER: writer}, mode=mode)
                        return Version.of(put)
                    except (AlreadyExistsError, PreconditionError):
                        pass
            except (ConnectionError, TimeoutError) as error:
                if tried + 1 == _TRIES or isinstance(error, ConnectionRefusedError):
                    raise
                continue
            standing = self._standing(name)
            if standing is not None:
                version, author = standing
                if author == writer:
                    return version
                if mode == "create" or version.condition() != mode:
                    return None
            elif mode != "create":
                return None
        raise ConnectionError(f"could not write {name} in {self.address}: others keep doing so")

    def _standing(self, name: str) -> tuple[Version, str] | None:
        """Return the version and the author of what is under a name, None if nothing is."""
        with translated(self.address, "read", name):
            try:
                answer = self._store.get(name, options={"head": True})
            except FileNotFoundError:
                return None
            return Version.of(answer.meta), str(answer.attributes.get(_WRITER, ""))

    def delete(self, names: list[str]) -> None:
        """Remove what is under the names; what is not there is fine."""
        if names:
            with translated(self.address, "remove", names[0]):
                self._store.delete(names)

    def copy(self, source: str, target: str) -> None:
        """Copy inside the server, over what is there."""
        with translated(self.address, "copy", source):
            self._store.copy(source, target)

    def list(self, folder: str) -> Iterator[Entry]:
        """Give all names below a folder (``actions/``; empty for all), sorted."""
        with translated(self.address, "list", folder or "everything"):
            for page in self._store.list(folder.rstrip("/") or None, chunk_size=_PAGE):
                for meta in page:
                    yield Entry(meta["path"], meta["size"], meta["last_modified"].timestamp())
