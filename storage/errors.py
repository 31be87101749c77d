"""Name what can go wrong with a store; every message says what to do."""

from __future__ import annotations

import errno


class StoreError(Exception):
    """Any failure of the artifact store."""


class StoreMissing(StoreError):
    """There is no store at the given path."""


class StoreFormatError(StoreError):
    """The folder is no store, or one of a format that this version does not know."""


class StoreFull(StoreError):
    """The disk (or its quota) that carries the store has no room left."""


class StoreReadOnly(StoreError):
    """The store cannot be written to."""


class StoreDenied(StoreError):
    """The store's server does not let these credentials see it."""


class MissingArtifact(StoreError):
    """An object is not in the store."""


class SchemaMismatch(StoreError):
    """An object does not hold the kind of value that was asked for."""


class Unstorable(StoreError, TypeError):
    """A value of a kind that has no canonical form; the message names where it is."""


class CorruptArtifact(StoreError):
    """An object whose bytes are not those that were published."""

    def __init__(self, object_digest: str, reason: str) -> None:
        super().__init__(f"artifact {object_digest[:15]} is corrupt: {reason}")
        self.object_digest = object_digest
        self.reason = reason


_FULL = {errno.ENOSPC, errno.EDQUOT}
_READ_ONLY = {errno.EROFS, errno.EACCES, errno.EPERM}


def explain_os_error(error: OSError, store: str) -> StoreError | None:
    """Return the store's own error for a full or read-only disk, else None."""
    if error.errno in _FULL:
        return StoreFull(
            f"the disk of the store {store} is full: free space there, run `garden store gc`,"
            " or choose another store with --store; nothing half-written was kept"
        )
    if error.errno in _READ_ONLY:
        return StoreReadOnly(
            f"the store {store} cannot be written ({error.strerror}): change its permissions"
            " or choose another store with --store"
        )
    return None
