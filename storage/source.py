"""Name a file that comes from outside by what is in it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from storage.canonical import UNKEYED
from storage.digest import digest_file


@dataclass(frozen=True)
class SourceFile:
    """A user's file: its name and content count in an action key, its place does not."""

    name: str
    size: int  # bytes
    digest: str
    path: str = field(default="", compare=False, metadata={UNKEYED: True})

    @classmethod
    def of(cls, path: str | Path) -> SourceFile:
        """Hash the file at ``path``."""
        place = Path(path)
        return cls(place.name, place.stat().st_size, digest_file(place), str(place.resolve()))
