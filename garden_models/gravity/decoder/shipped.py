"""Find the decoder that comes with the program, by its digest."""

from __future__ import annotations

from pathlib import Path

FILE = Path(__file__).parent / "weights" / "gravity_decoder.safetensors"
DIGEST = ""
"""BLAKE3 of the shipped file; empty: none is shipped."""


def checkpoint_file() -> Path | None:
    """Return the shipped checkpoint, None if there is none."""
    return FILE if DIGEST else None
