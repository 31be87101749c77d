"""SEALED, NO-DANGLING, ORPHANS-ONLY: whatever single call fails, nothing breaks, a rerun mends.

``python -m tests.faults`` disturbs every call; here it is a sample.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from storage import Store
from tests.faults.crashes import DEEDS, HOW, Deed, Trials, disturb, publish
from tests.storage.faulty import FaultyOs, disk

SAMPLE = 4  # calls for each deed and way


def violations(deed: Deed, folder: Path) -> list[str]:
    trials = Trials(deed, folder)
    calls = len(trials.operations)
    assert calls > 20
    found: list[str] = []
    for number, how in enumerate(HOW):
        for count in disturb(trials, how, range(number, calls, calls // SAMPLE)):
            found += count.violations
    return found


@pytest.mark.parametrize("deed", DEEDS, ids=lambda d: d.name)
def test_sealed_and_no_dangling_at_some_calls(tmp_path: Path, deed: Deed) -> None:
    assert violations(deed, tmp_path) == []


@pytest.mark.parametrize("forgotten", ["members", "manifest", "folders"])
def test_the_shim_notices_a_missing_fsync(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, forgotten: str
) -> None:
    """Leave one kind of fsync out, and the tests above would fail."""
    fsync = FaultyOs.fsync

    def lazy(self: FaultyOs, path: Path) -> None:
        kind = "folders" if path.is_dir() else "members"
        if (kind if path.name != "manifest.json" else "manifest") != forgotten:
            fsync(self, path)

    monkeypatch.setattr(FaultyOs, "fsync", lazy)
    store = Store.open(tmp_path / "store")
    faulty = FaultyOs()
    with disk(faulty):
        publish(store)
    faulty.lose_power()
    assert not list(store.actions()) or store.verify("full") != []
