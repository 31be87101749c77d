"""Say what carries a store: a folder or a bucket, seen as named documents and sealed objects.

What a store promises (``INVARIANTS.md``) is written once, over this; a medium only knows how
to make each single change happen at once and stay. All its methods raise OSError where the
disk or the network fails, and are safe for many threads and processes at once.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Literal, Protocol

from storage.errors import StoreError
from storage.leases import LeaseTable
from storage.members import MemberWriter
from storage.read_cache import ReadCache

Level = Literal["manifest", "full"]


class Medium(Protocol):
    """What carries a store. Names of documents are relative, with ``/``."""

    address: str
    """How a user, or another process, names the store."""

    recheck: Level
    """How thoroughly an object that is already there is checked before it counts as published
    again: as much as is cheap beside writing it."""

    readers: int
    """How many members are best read at once; 1 where reading one already takes all there is."""

    cache: ReadCache | None
    """What keeps members on this machine, where the medium is not on it."""

    def prepare(self) -> None:
        """Make the place for a new store.

        Raises:
            StoreMissing: the place cannot be made from here.
            StoreFormatError: it holds something else.
        """

    @property
    def leases(self) -> LeaseTable:
        """Who computes which key."""

    # -- documents ------------------------------------------------------------------------

    def read(self, name: str) -> bytes | None:
        """Return a document, None if there is none."""

    def create(self, name: str, data: bytes) -> bool:
        """Make a durable document at once; False if the name is taken: the first one stays."""

    def replace(self, name: str, data: bytes) -> None:
        """Make or change a document at once. Only for what may change or is derived."""

    def delete(self, *names: str) -> None:
        """Remove documents, for good when it returns; nothing happens where there is none."""

    def clear(self, prefix: str) -> None:
        """Remove a folder like ``quarantine/X/`` and all documents below it."""

    def touch(self, name: str) -> None:
        """Make an empty document, or make it young again if it is older than an hour.

        Cheap when it is not. Nothing happens where nothing can be written.
        """

    def names(self, prefix: str) -> Iterator[str]:
        """Give the name of every document below a folder like ``actions/``, sorted."""

    def times(self, prefix: str) -> Iterator[tuple[str, float]]:
        """Give what ``names`` gives, and when each was last written (Unix seconds)."""

    # -- objects --------------------------------------------------------------------------

    def stage(self) -> AbstractContextManager[MemberWriter]:
        """Give a place for an object's members that nobody sees; it is removed at the end."""

    def seal(self, staged: MemberWriter, digest: str, manifest: bytes) -> bool:
        """Publish staged members as the object ``digest``, whole or not at all.

        False if somebody else has: theirs stays.
        """

    def refresh(self, digest: str, manifest: bytes) -> None:
        """Make an object that is published again young, if it is older than an hour.

        A collector leaves young objects alone, and this one gets its action only now.
        """

    def objects(self) -> Iterator[str]:
        """Give the digest of every object, sorted."""

    def members(self, digest: str) -> dict[str, int]:
        """Return the files of an object and their bytes, its manifest among them.

        Empty if there is nothing of it, or not yet all.
        """

    def read_member(self, digest: str, path: str, start: int = 0, stop: int | None = None) -> bytes:
        """Return the bytes ``start:stop`` of a file of an object, fewer if it is shorter.

        Raises FileNotFoundError if there is none.
        """

    def member_digest(self, digest: str, path: str) -> str:
        """Return the digest of a file of an object; FileNotFoundError if there is none."""

    def published_at(self, digest: str) -> float:
        """Return when an object was published (Unix seconds); FileNotFoundError if it is gone."""

    def quarantine(self, digest: str) -> bool:
        """Move a damaged object out of the way for autopsy; False if it was gone already."""

    def remove(self, *digests: str) -> None:
        """Remove objects, so that at no instant a part of one looks like a whole.

        Their names are gone for good when it returns; their room may come back only with
        ``sweep``.
        """

    # -- room and order -------------------------------------------------------------------

    def publishing(self) -> AbstractContextManager[None]:
        """Hold off ``collecting``, as many at once as like, while names are made."""

    def collecting(self) -> AbstractContextManager[None]:
        """Be alone: nobody is ``publishing`` meanwhile."""

    def scratch(self) -> AbstractContextManager[Path]:
        """Give a folder on this machine for libraries that need files; then remove it."""

    def sweep(self) -> int:
        """Remove what was removed, and what the dead left unfinished; return how many things."""

    def explain(self, error: OSError) -> StoreError | None:
        """Return the store's own error for a full or read-only medium, else None."""
