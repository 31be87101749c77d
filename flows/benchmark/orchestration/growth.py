"""Count what lies in a folder: files, folders, their bytes and the disk that they take."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

_BLOCK = 512  # bytes, of st_blocks


@dataclass(frozen=True)
class Growth:
    """``files`` and ``folders`` take an inode each; ``disk_bytes`` counts whole blocks."""

    files: int = 0
    folders: int = 0
    bytes: int = 0
    disk_bytes: int = 0


def growth_of(folder: Path) -> Growth:
    """Return what lies below a folder, itself left out; nothing if there is none."""
    files = folders = size = blocks = 0
    waiting = [folder] if folder.is_dir() else []
    while waiting:
        for entry in os.scandir(waiting.pop()):
            status = entry.stat(follow_symlinks=False)
            blocks += status.st_blocks
            if entry.is_dir(follow_symlinks=False):
                folders += 1
                waiting.append(Path(entry.path))
            else:
                files += 1
                size += status.st_size
    return Growth(files, folders, size, blocks * _BLOCK)


def growth_by_part(folder: Path) -> dict[str, Growth]:
    """Return what lies in each sub-folder."""
    return {place.name: growth_of(place) for place in sorted(folder.iterdir()) if place.is_dir()}
