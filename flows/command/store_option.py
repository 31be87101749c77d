"""Open the store that a command means."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from storage import Store
from storage.address import is_remote
from storage.user_folders import cache_folder


def open_store(options: argparse.Namespace, create: bool = True) -> Store:
    """Open the store that ``--store``, ``$GARDEN_STORE`` or the cache folder names."""
    return Store.open(store_address(options.store), create=create)


def store_address(given: str | None) -> str:
    """Return what ``Store.open`` takes, in any process of this machine."""
    address = given or os.environ.get("GARDEN_STORE") or str(cache_folder() / "store")
    return address if is_remote(address) else str(Path(address).expanduser().absolute())
