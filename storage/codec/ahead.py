"""Have what reading and publishing take imported before there is something to do."""

from __future__ import annotations

import importlib
import threading


def import_codec() -> None:
    """Import how values are read and written; Zarr takes a third of a second."""
    for module in ("storage.codec.arrays", "storage.codec.values"):
        importlib.import_module(module)


def import_codec_meanwhile() -> None:
    """Do so in a thread of its own; return at once."""
    threading.Thread(target=import_codec, name="imports").start()
