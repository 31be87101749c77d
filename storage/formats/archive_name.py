"""Tell by its name whether a file is an archive that a capture may come in."""

from __future__ import annotations

from pathlib import Path

SUFFIXES = (".zip", ".tar", ".tar.gz", ".tgz")
MAX_BYTES = 50_000_000_000
"""Of the archive, and of all that is in it."""


def is_archive(path: Path) -> bool:
    """Tell whether ``storage.formats.archive`` unpacks files of this name."""
    return path.name.lower().endswith(SUFFIXES)


def archive_stem(path: Path) -> str:
    """Return an archive's name without its suffix: ``room`` for ``room.tar.gz``."""
    suffix = max((s for s in SUFFIXES if path.name.lower().endswith(s)), key=len)
    return path.name[: -len(suffix)]
