"""Say where this user's caches and settings lie."""

from __future__ import annotations

import os
from pathlib import Path


def cache_folder() -> Path:
    """Return GARDEN's folder in the user's cache: ``$XDG_CACHE_HOME/garden``."""
    return _folder("XDG_CACHE_HOME", ".cache")


def config_folder() -> Path:
    """Return GARDEN's folder among the user's settings: ``$XDG_CONFIG_HOME/garden``."""
    return _folder("XDG_CONFIG_HOME", ".config")


def _folder(variable: str, default: str) -> Path:
    given = os.environ.get(variable)
    return (Path(given) if given else Path.home() / default) / "garden"
