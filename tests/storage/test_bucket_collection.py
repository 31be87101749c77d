"""Pins, collection, repair and the catalogue, over a bucket on a real server.

The server's clock cannot be set back: collections happen in the future.
"""

from __future__ import annotations

import dataclasses
import time
from typing import Any

import pytest

from storage import Keep, MissingArtifact, Store, StoreError
from storage.actions import action_name
from storage.collect import Collected, collect
from tests.storage.history import DAY_S, key_of, keys, value
from tests.storage.media import behind, files_of
from tests.storage.test_bucket import IN_A_BUCKET
from tests.storage.test_store import record_of

pytestmark = IN_A_BUCKET


def did(store: Store, name: str, number: int, scene: str = "kitchen") -> Any:
    record = store.record(record_of(store, value(number), key=key_of(name), scene=scene))
    store.remember_latest(record, scene, record.label)
    return record


def collect_in(store: Store, days: float, quota_bytes: int | None = 0) -> Collected:
    now = time.time() + days * DAY_S
    return collect(store.medium, Keep(), quota_bytes=quota_bytes, now=now)


def test_what_is_held_or_young_stays_and_all_else_goes(store: Store) -> None:
    old, pinned = did(store, "old", 1), did(store, "pinned", 2, scene="good")
    leased = did(store, "leased", 3)
    orphan = store.publish(value(9)).object
    store.pin("night", scenes=["good"])
    lease = store.acquire(leased.key)
    assert lease is not None
    assert collect_in(store, 0.5).forgotten == ()
    done = collect_in(store, 3)
    assert [one.key for one in done.forgotten] == [old.key]
    assert keys(store) == {pinned.key, leased.key}
    assert files_of(store, orphan) == []
    assert files_of(store, old.outputs["value"].object) == []
    assert store.verify("full") == []
    assert store.latest("kitchen", old.step, old.label) is not None
    assert done.bytes_left == store.size()


def test_orphans_go_without_a_quota_and_results_stay(store: Store) -> None:
    record, orphan = did(store, "a", 1), store.publish(value(9)).object
    done = collect_in(store, 3, quota_bytes=None)
    assert (done.objects, done.forgotten) == (1, ())
    assert set(store.medium.objects()) == {record.outputs["value"].object}
    assert files_of(store, orphan) == []


def test_no_dangling_an_action_that_comes_while_its_object_goes(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing holds a writer off: what it records just then is forgotten again."""
    record = did(store, "a", 1)
    late = dataclasses.replace(record, key=key_of("late"))
    remove = type(store.medium).remove

    def during(medium: Any, *digests: str) -> None:
        medium.create(action_name(late.key), late.to_bytes())
        remove(medium, *digests)

    monkeypatch.setattr(type(store.medium), "remove", during)
    collect_in(store, 3)
    assert keys(store) == set()
    assert store.verify("full") == []
    with pytest.raises(MissingArtifact):
        store.record(late)


def test_one_collects_at_a_time_and_a_dead_one_hinders_nobody(store: Store) -> None:
    did(store, "a", 1)
    medium = Store.open(store.address, lease_s=0.5).medium
    collecting = medium.collecting()
    collecting.__enter__()
    medium.leases.abandon_all()  # as if its process had died on another machine
    collect_in(store, 3)
    assert keys(store) == set()


def test_damage_is_repaired_and_good_results_stay(store: Store) -> None:
    bad, good = did(store, "bad", 1), did(store, "good", 2)
    unread = did(store, "unread", 3)
    for name in files_of(store, bad.outputs["value"].object):
        if "/c/" in name or "/c." in name:
            behind(store).put(name, b"x" * len(behind(store).get(name)))
    behind(store).put(action_name(unread.key), b"{")
    assert store.verify()
    store.repair()
    assert store.verify() == []
    assert keys(store) == {good.key}
    assert store.lookup(good.key) == (good, "hit")
    assert behind(store).names("quarantine/")


def test_the_catalogue_is_right_and_derived(store: Store) -> None:
    for number in range(3):
        did(store, f"k{number}", number)
    before = store.catalogue().to_pylist()
    assert store.compact() == 3
    assert len(behind(store).names("catalog/")) == 1
    assert store.catalogue().to_pylist() == before
    assert store.find(key_of("k1")[:12])[0].key == key_of("k1")
    store.medium.clear("catalog/")
    assert store.catalogue().to_pylist() == before


def test_pins_are_documents_like_others(store: Store) -> None:
    store.pin("a", [key_of("a")], reason="why")
    with pytest.raises(StoreError, match="already"):
        store.pin("a", [key_of("b")])
    assert [(pin.name, pin.reason) for pin in store.pins()] == [("a", "why")]
    assert store.unpin("a")
    assert store.pins() == []
