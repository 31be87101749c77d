"""Actions of a made-up past: small ones by the name of their key, and older than they are."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Any

import numpy as np

from storage import ActionRecord, Store
from storage.actions import action_name
from storage.digest import digest_value
from storage.forget import use_name
from tests.storage.samples import View
from tests.storage.test_store import record_of

DAY_S = 24 * 3600.0


def value(number: int) -> View:
    """Return a small value that differs from those of other numbers."""
    return View(f"{number}.jpg", np.full((3, 4, 3), number % 251, np.uint8), np.eye(3) * number)


def key_of(name: str) -> str:
    return digest_value(name, domain="test/1")


def did(store: Store, name: str, number: int = 0, days_ago: float = 0.0, **changes: Any) -> Any:
    """Record an action of that key, as if done and last used so long ago."""
    started = time.time() - days_ago * DAY_S
    given = {"scene": "kitchen", "step": "segment", "label": "", **changes}
    record = store.record(
        record_of(store, value(number), key=key_of(name), started=started, **given)
    )
    store.remember_latest(record, record.scene, record.label)
    age(store, record, days_ago)
    return record


def age(store: Store, record: ActionRecord, days: float) -> None:
    """Make an action, its last use and its objects look older."""
    for output in record.outputs.values():
        backdate(store.folder(output.object) / "manifest.json", days)
    backdate(store.path / action_name(record.key), days)
    backdate(store.path / use_name(record.key), days)


def backdate(path: Path, days: float) -> None:
    if path.exists():
        when = time.time() - days * DAY_S
        os.utime(path, (when, when))


def keys(store: Store) -> set[str]:
    return {record.key for record in store.actions()}
