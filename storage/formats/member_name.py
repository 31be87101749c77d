"""Tell which file names of a manifest, a package or an archive stay inside their folder."""

from __future__ import annotations

import re

_DRIVE = re.compile(r"[A-Za-z]:")
_LONGEST_PART = 255
_LONGEST = 1024


def is_inside(name: str) -> bool:
    """Tell whether a relative name with ``/`` between its parts can only lead further in.

    Backslashes, drives and control characters count as leading out, on every system.
    """
    parts = name.split("/")
    if {"", ".", ".."} & set(parts) or _DRIVE.match(name) or "\\" in name:
        return False
    if any(ord(letter) < 32 or ord(letter) == 127 for letter in name):
        return False
    sizes = [len(part.encode(errors="surrogateescape")) for part in parts]
    return max(sizes) <= _LONGEST_PART and sum(sizes) <= _LONGEST
