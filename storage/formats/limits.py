"""Refuse files that are larger than their kind can be, before they are read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from storage.formats.errors import UnreadableInput

MAX_JSON_BYTES = 64_000_000
"""A ``transforms.json`` of 50,000 photos has about half of it."""


def check_file_size(path: Path, limit: int, kind: str) -> None:
    """Raise UnreadableInput for a file of more than ``limit`` bytes, or that is not there."""
    try:
        size = path.stat().st_size
    except OSError as error:
        raise UnreadableInput(f"{path} cannot be read ({error.strerror}): check it") from error
    if size > limit:
        raise UnreadableInput(
            f"{path} is too large for {kind} ({in_words(size)}; at most {in_words(limit)}): "
            "check that it is the right file, or make it smaller"
        )


def read_json(path: Path, limit: int = MAX_JSON_BYTES) -> Any:
    """Return the document in a JSON file of at most ``limit`` bytes.

    Raises:
        UnreadableInput: it is larger.
        FileNotFoundError, OSError: it cannot be read.
        ValueError: it is not JSON, or nested too deeply.
    """
    if path.exists():
        check_file_size(path, limit, "a JSON file")
    try:
        return json.loads(path.read_text("utf-8"))
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def in_words(size: int) -> str:
    """Return a number of bytes for the user: ``12 MB``, ``1.5 GB``."""
    for unit, name in ((1e9, "GB"), (1e6, "MB"), (1e3, "kB")):
        if size >= unit:
            return f"{size / unit:.3g} {name}"
    return f"{size} bytes"
