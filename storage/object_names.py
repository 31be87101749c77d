"""Name the files of objects in a bucket: ``objects/b3/ab/cdef.../manifest.json``."""

from __future__ import annotations

from storage.digest import hexadecimal
from storage.manifest import MANIFEST

OBJECTS = "objects/b3/"
_PARTS = 5  # of a manifest's name


def object_prefix(digest: str) -> str:
    """Return what the names of an object's files begin with."""
    name = hexadecimal(digest)
    return f"{OBJECTS}{name[:2]}/{name[2:]}/"


def prefix_of(name: str) -> str:
    """Return the prefix of the object that a file belongs to."""
    return "/".join(name.split("/")[: _PARTS - 1]) + "/"


def sealed_by(name: str) -> str | None:
    """Return the digest of the object whose manifest has this name; None for other files."""
    parts = name.split("/")
    if len(parts) != _PARTS or parts[-1] != MANIFEST:
        return None
    return f"b3:{parts[2]}{parts[3]}"
