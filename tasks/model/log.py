"""Keep what the models' workers print: ``logs/models.log`` in the user's cache."""

from __future__ import annotations

import logging
import os
from logging.handlers import RotatingFileHandler
from pathlib import Path
from typing import TextIO

from storage.user_folders import cache_folder

_BYTES, _OLDER = 5_000_000, 3
_ROOT = "garden.model"


def log_file() -> Path:
    """Return where the lines go."""
    return cache_folder() / "logs" / "models.log"


def model_log(name: str) -> logging.Logger:
    """Return the log of one model; its lines go to ``log_file`` with time and name."""
    root = logging.getLogger(_ROOT)
    if not any(getattr(h, "baseFilename", "") == str(log_file()) for h in root.handlers):
        _open(root)
    return root.getChild(name)


def _open(root: logging.Logger) -> None:
    for old in root.handlers:
        old.close()
    root.handlers[:] = [_handler(log_file())]
    root.setLevel(logging.INFO)
    root.propagate = False


def _handler(file: Path) -> logging.Handler:
    """Return what writes to a file; to standard error where the file cannot be written."""
    handler: logging.Handler
    try:
        file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        handler = RotatingFileHandler(file, maxBytes=_BYTES, backupCount=_OLDER)
    except OSError:
        handler = _ToStandardError(str(file))
    handler.setFormatter(logging.Formatter(f"%(asctime)s {os.getpid()} %(name)s %(message)s"))
    return handler


class _ToStandardError(logging.StreamHandler[TextIO]):
    """Stands in for a file that cannot be written."""

    def __init__(self, file: str) -> None:
        super().__init__()
        self.baseFilename = file
