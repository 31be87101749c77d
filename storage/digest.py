"""Hash with BLAKE3; a digest is written ``b3:`` and 64 hexadecimal digits."""

from __future__ import annotations

import re
from pathlib import Path

from blake3 import blake3

from storage.canonical import NanPolicy, canonical

PREFIX = "b3:"
_PATTERN = re.compile(r"b3:[0-9a-f]{64}")
_PARALLEL_FROM = 1 << 20  # bytes; below it a second thread costs more than it gives


def digest_bytes(data: bytes | memoryview) -> str:
    """Return the digest of ``data``."""
    view = memoryview(data).cast("B")
    threads = blake3.AUTO if len(view) >= _PARALLEL_FROM else 1
    return PREFIX + blake3(view, max_threads=threads).hexdigest()


def digest_file(path: Path) -> str:
    """Return the digest of a file's bytes without reading it into memory at once."""
    hasher = blake3(max_threads=blake3.AUTO)
    hasher.update_mmap(path)
    return PREFIX + hasher.hexdigest()


def digest_value(value: object, *, domain: str, nan: NanPolicy = "reject") -> str:
    """Return the digest of a value's canonical bytes (``storage.canonical``)."""
    return digest_bytes(canonical(value, domain=domain, nan=nan))


def is_digest(text: str) -> bool:
    """Tell whether ``text`` is ``b3:`` and 64 hexadecimal digits."""
    return _PATTERN.fullmatch(text) is not None


def hexadecimal(digest: str) -> str:
    """Return the 64 digits of a digest; ValueError if it is none (paths are made of it)."""
    if not _PATTERN.fullmatch(digest):
        raise ValueError(f"{digest!r} is not a digest (b3: and 64 hexadecimal digits)")
    return digest[len(PREFIX) :]
