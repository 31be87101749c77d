"""Maintenance checks the store, removes what nothing needs, and says what it found."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Any

import numpy as np

from flows.deployed.maintenance import maintain_store
from storage import Store
from tests.tasks.step.toy import Numbers, chain, in_run


def maintained(store: Store, **options: Any) -> Any:
    """Run the flow's function, without a server."""
    return maintain_store.fn(str(store.path), **options)


def a_store(folder: Path) -> Store:
    store = Store.open(folder / "store", durability="none")
    in_run(store, chain)
    return store


def age(store: Store, hours: float = 3.0) -> None:
    """Make all artifacts older than those that may still get their action."""
    for manifest in store.path.glob("objects/**/manifest.json"):
        then = time.time() - hours * 3600
        os.utime(manifest, (then, then))


def test_a_sound_store_is_left_as_it_is_and_catalogued(tmp_path: Path) -> None:
    store = a_store(tmp_path)
    before = sorted(store.objects())
    state = maintained(store)
    assert state.name == "Completed"
    assert state.data["problems"] == state.data["removed"] == 0
    assert state.data["catalogue_rows"] == 3
    assert sorted(store.objects()) == before


def test_what_no_action_gives_is_removed_when_it_is_old_enough(tmp_path: Path) -> None:
    store = a_store(tmp_path)
    orphan = store.publish(Numbers(np.arange(1000.0)))
    assert maintained(store, grace_hours=0.0).data["removed"] == 0, "it may still get its action"
    age(store)
    state = maintained(store)
    assert state.data["removed"] == 1
    assert orphan.object not in dict(store.objects())
    assert "1 artifacts removed" in state.message


def test_a_quota_lets_the_longest_unused_go(tmp_path: Path) -> None:
    store = a_store(tmp_path)
    age(store)
    assert maintained(store, quota_gb=0.0).data["forgotten"] == 0, "used within the grace"
    state = maintained(store, quota_gb=0.0, grace_hours=0.0)
    assert state.data["forgotten"] == 3
    assert store.size() == 0


def test_damage_is_told_and_not_repaired_unasked(tmp_path: Path) -> None:
    store = a_store(tmp_path)
    member = next(p for p in (store.path / "objects").rglob("c.0"))
    member.chmod(0o644)
    member.write_bytes(bytes([member.read_bytes()[0] ^ 1]) + member.read_bytes()[1:])
    state = maintained(store)
    assert state.name == "Degraded"
    assert "garden store repair" in state.message
    assert state.data["problems"] >= 1
    assert member.exists()


def test_where_no_store_is_none_is_made(tmp_path: Path) -> None:
    state = maintain_store.fn(str(tmp_path / "nothing"))
    assert state.name == "Failed"
    assert "nothing" in state.message
    assert not (tmp_path / "nothing").exists()
