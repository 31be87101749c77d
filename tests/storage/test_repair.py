"""Repair: whatever happened to a store, it comes back to its invariants with all good results."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from storage import ActionRecord, Store
from storage.actions import action_name
from storage.keep import Keep
from tests.storage.history import did, key_of, keys


def the_object(store: Store, record: ActionRecord) -> Path:
    return store.folder(record.outputs["value"].object)


def flip(store: Store, record: ActionRecord) -> None:
    files = [p for p in the_object(store, record).rglob("*") if p.is_file()]
    member = max((p for p in files if p.suffix != ".json"), key=lambda p: p.stat().st_size)
    data = bytearray(member.read_bytes())
    data[len(data) // 2] ^= 1
    member.chmod(0o644)
    member.write_bytes(bytes(data))


def lose_manifest(store: Store, record: ActionRecord) -> None:
    (the_object(store, record) / "manifest.json").unlink()


def add_file(store: Store, record: ActionRecord) -> None:
    (the_object(store, record) / "notes.txt").write_text("mine")


def empty_object(store: Store, record: ActionRecord) -> None:
    shutil.rmtree(the_object(store, record))
    the_object(store, record).mkdir()


def lose_object(store: Store, record: ActionRecord) -> None:
    shutil.rmtree(the_object(store, record))


def garble_action(store: Store, record: ActionRecord) -> None:
    place = store.path / action_name(record.key)
    place.chmod(0o644)
    place.write_bytes(b"\x00{")


def misplace_action(store: Store, record: ActionRecord) -> None:
    place = store.path / action_name(record.key)
    place.rename(place.with_name("0" * 62 + ".json"))


def stray_action(store: Store, record: ActionRecord) -> None:
    place = store.path / action_name(record.key)
    place.rename(store.path / "actions" / "notes.txt")


def stray_object(store: Store, record: ActionRecord) -> None:
    place = the_object(store, record)
    place.rename(place.with_name("backup"))


DAMAGES: list[Callable[[Store, ActionRecord], None]] = [
    flip,
    lose_manifest,
    add_file,
    empty_object,
    lose_object,
    garble_action,
    misplace_action,
    stray_action,
    stray_object,
]


@pytest.mark.parametrize("damage", DAMAGES, ids=lambda f: f.__name__)
def test_damage_goes_to_quarantine_and_good_results_stay(
    store: Store, damage: Callable[[Store, ActionRecord], None]
) -> None:
    bad, good = did(store, "bad", 1), did(store, "good", 2)
    damage(store, bad)
    problems = store.verify()
    assert problems
    assert all("garden store repair" in str(problem) for problem in problems)
    repaired = store.repair()
    assert {r.where for r in repaired} >= {p.where for p in problems if p.kind != "dangling"}
    assert store.verify() == []
    assert store.repair() == []
    assert keys(store) == {good.key}
    assert store.lookup(good.key) == (good, "hit")
    assert did(store, "bad", 1).same_outputs(bad)
    assert store.verify() == []


def test_what_is_repaired_is_kept_for_autopsy(store: Store) -> None:
    bad = did(store, "bad", 1)
    garble_action(store, bad)
    flip(store, did(store, "worse", 2))
    store.repair()
    kept = {path.name for path in (store.path / "quarantine").rglob("*") if path.is_file()}
    assert Path(action_name(bad.key)).name in kept
    assert "manifest.json" in kept


def test_a_result_that_two_actions_gave_is_forgotten_twice(store: Store) -> None:
    one, two = did(store, "one", 1), did(store, "two", 1)
    flip(store, one)
    store.repair()
    assert keys(store) == set()
    assert store.lookup(two.key) == (None, "absent")


def test_clears_up_what_hinders_nobody(store: Store) -> None:
    did(store, "a")
    (store.path / "trash" / "x").mkdir(parents=True)
    (store.path / "latest" / "y").mkdir()
    (store.path / "latest" / "y" / "z.json").write_text("[")
    (store.path / "leases").mkdir()
    lease = store.path / "leases" / f"{key_of('a')[3:]}.json"
    lease.write_text("")
    assert store.verify() == []
    assert len(store.repair()) == 3
    assert store.repair() == []
    assert not lease.exists()
    assert store.latest("kitchen", "segment") is not None


def test_a_repaired_store_can_be_collected(store: Store) -> None:
    flip(store, did(store, "a", 1, days_ago=9))
    store.repair()
    store.collect(quota_bytes=0, keep=Keep(unrecorded_s=0.0, evidence_s=0.0))
    assert [p for p in store.path.rglob("*.json") if p.name != "store.json"] == []
