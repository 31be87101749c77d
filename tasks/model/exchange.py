"""Give a folder in which a question and its answer lie while a worker is asked."""

from __future__ import annotations

import contextlib
import os
import shutil
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tasks.step.slots import runtime_folder

VARIABLE = "GARDEN_EXCHANGE"
_LEFT_S = 86400.0


def exchange_root() -> Path:
    """Return the user's folder for exchanges: ``$GARDEN_EXCHANGE``, else a temporary one.

    Workers in containers must see it at the same place.
    """
    given = os.environ.get(VARIABLE)
    root = Path(given) if given else runtime_folder() / "exchange"
    root.mkdir(mode=0o700, parents=True, exist_ok=True)
    return root


@contextmanager
def exchange() -> Iterator[Path]:
    """Give a new folder, and remove it with what it holds."""
    folder = exchange_root() / f"{os.getpid()}-{uuid.uuid4().hex}"
    folder.mkdir(mode=0o700)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def sweep() -> None:
    """Remove the exchanges that processes which are gone left behind a day ago or longer."""
    for folder in exchange_root().iterdir():
        with contextlib.suppress(OSError):
            if time.time() - folder.stat().st_mtime > _LEFT_S:
                shutil.rmtree(folder, ignore_errors=True)
