"""Collection: what it forgets and keeps, in which order, and beside whom."""

from __future__ import annotations

import dataclasses
import errno
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from storage import Store
from storage.collect import collect
from storage.forget import use_name
from storage.keep import Keep
from tests.storage.faulty import FaultyOs, disk
from tests.storage.history import DAY_S, age, backdate, did, key_of, keys, value
from tests.storage.test_store import record_of

NOTHING = Keep(unused_s=0.0, last=0, unrecorded_s=0.0)
SIZE = 1  # bytes: a quota that nothing fits


def names(store: Store, *known: str) -> set[str]:
    return {name for name in known if key_of(name) in keys(store)}


def test_without_a_policy_only_what_nobody_needs_goes(store: Store) -> None:
    did(store, "a", 1, days_ago=900)
    orphan = store.publish(value(2)).object
    young = store.publish(value(3)).object
    backdate(store.folder(orphan) / "manifest.json", 1)
    done = store.collect()
    assert (done.forgotten, done.objects) == ((), 1)
    assert done.freed_bytes > 0
    assert names(store, "a") == {"a"}
    objects = {digest for digest, _size in store.objects()}
    assert orphan not in objects
    assert young in objects


def test_the_quota_takes_the_longest_unused_first(store: Store) -> None:
    for days, name in enumerate(("a", "b", "c", "d"), start=2):
        did(store, name, days, days_ago=days, label=name)
    one = store.size() // 4
    done = store.collect(quota_bytes=2 * one + 100)
    assert names(store, "a", "b", "c", "d") == {"a", "b"}
    assert {f.why for f in done.forgotten} == {"to come under the quota"}
    assert done.bytes_left == store.size() <= 2 * one + 100
    assert [f.key for f in done.forgotten] == [key_of("d"), key_of("c")]


def test_a_hit_is_a_use_also_in_the_quota(store: Store) -> None:
    did(store, "a", 1, days_ago=9)
    did(store, "b", 2, days_ago=5)
    assert store.lookup(key_of("a"))[1] == "hit"
    store.collect(quota_bytes=SIZE)
    assert names(store, "a", "b") == {"a"}


def test_a_hit_leaves_a_mark_once_an_hour_and_a_plan_none(store: Store) -> None:
    record = did(store, "a", days_ago=1)
    mark = store.path / use_name(record.key)
    store.lookup(record.key, mend=False)
    assert not mark.exists()
    store.lookup(record.key)
    backdate(mark, 0.5 / 24)
    before = mark.stat().st_mtime_ns
    store.lookup(record.key)
    assert mark.stat().st_mtime_ns == before
    backdate(mark, 2 / 24)
    store.lookup(record.key)
    assert mark.stat().st_mtime_ns > before


def test_what_is_young_in_use_or_being_computed_stays(store: Store) -> None:
    did(store, "young", 1, days_ago=0.5)
    leased = did(store, "leased", 2, days_ago=9)
    pinned = did(store, "pinned", 3, days_ago=9)
    did(store, "old", 4, days_ago=9)
    store.pin("p", [pinned.key])
    assert store.acquire(leased.key) is not None
    done = store.collect(quota_bytes=0)
    assert names(store, "young", "leased", "pinned", "old") == {"young", "leased", "pinned"}
    assert done.bytes_left == store.size() > 0


def test_the_newest_of_a_step_outlive_their_age_but_not_the_quota(store: Store) -> None:
    for days in range(2, 6):
        did(store, f"k{days}", days, days_ago=days)
    did(store, "alone", 9, days_ago=50, label="mug")
    store.collect(keep=Keep(unused_s=DAY_S, last=2))
    assert names(store, "k2", "k3", "k4", "k5", "alone") == {"k2", "k3", "alone"}
    store.collect(quota_bytes=0)
    assert keys(store) == set()


def test_an_object_that_another_action_gave_stays(store: Store) -> None:
    did(store, "old", 1, days_ago=9)
    shared = did(store, "new", 1, days_ago=0)
    age(store, dataclasses.replace(shared, key=key_of("old")), 9)
    store.collect(quota_bytes=0)
    assert keys(store) == {shared.key}
    assert store.lookup(shared.key) == (shared, "hit")


def test_a_dry_run_tells_the_same_and_changes_nothing(store: Store) -> None:
    for days in range(2, 6):
        did(store, f"k{days}", days, days_ago=days)
    before = sorted(store.path.rglob("*"))
    told = store.collect(quota_bytes=SIZE, dry_run=True)
    assert sorted(store.path.rglob("*")) == before
    done = store.collect(quota_bytes=SIZE)
    assert told.dry_run
    assert dataclasses.replace(told, dry_run=False, leftovers=0) == dataclasses.replace(
        done, leftovers=0
    )


def test_explained_what_was_collected_can_still_say_what_changed(store: Store) -> None:
    record = did(store, "a", days_ago=9)
    store.collect(quota_bytes=0)
    assert store.lookup(record.key) == (None, "absent")
    assert store.latest("kitchen", "segment") == record
    assert store.latest("kitchen", "segment", "other") is None
    backdate_all(store.path / "latest", 200)
    store.collect()
    assert store.latest("kitchen", "segment") is None


def test_evidence_is_kept_for_its_time(store: Store) -> None:
    first = did(store, "a", 1)
    store.record(dataclasses.replace(record_of(store, value(2)), key=first.key))
    damaged = store.publish(value(3)).object
    (store.folder(damaged) / "zarr.json").unlink()
    store.discard(damaged)
    store.collect()
    assert len(list((store.path / "conflicts").rglob("*.json"))) == 1
    assert len(list((store.path / "quarantine").iterdir())) == 1
    backdate_all(store.path / "conflicts", 91)
    collect(store.medium, Keep(), now=time.time() + 91 * DAY_S)
    assert list((store.path / "conflicts").rglob("*.json")) == []
    assert list((store.path / "quarantine").iterdir()) == []


def backdate_all(folder: Path, days: float) -> None:
    for path in folder.rglob("*.json"):
        backdate(path, days)


def test_orphans_only_all_that_a_dead_process_left_is_removed(store: Store) -> None:
    code = (
        "import os, sys; from storage import Store; from tests.storage.history import value\n"
        "store = Store.open(sys.argv[1]); store.publish(value(1)); store.acquire(sys.argv[2])\n"
        "with store.scratch(), store.scratch(): os._exit(9)"
    )
    command = [sys.executable, "-c", code, str(store.path), key_of("a")]
    subprocess.run(command, check=False)
    (store.path / "trash" / "x").mkdir(parents=True)
    assert len(list((store.path / "tmp").iterdir())) == 2
    store.collect(keep=Keep(unrecorded_s=0.0))
    for place in ("tmp", "trash"):
        assert list((store.path / place).iterdir()) == [], place
    assert list((store.path / "leases").glob("*.json")) == []
    assert list(store.objects()) == []


def test_a_full_disk_can_be_collected(store: Store) -> None:
    """Nothing can be written, but removing works: that is when it is needed."""

    class Full(FaultyOs):
        def write(self, path: Path, data: object) -> None:
            raise OSError(errno.ENOSPC, "No space left on device")

    did(store, "a", days_ago=9)
    with disk(Full()):
        store.collect(quota_bytes=0)
    assert keys(store) == set()
    assert list(store.objects()) == []


def test_a_step_publishes_between_two_collections_and_loses_nothing(store: Store) -> None:
    """The object stands alone until its action is there: it is too young to go."""
    did(store, "a", 7, days_ago=9)
    published = store.publish(value(7))  # the same old object, and again of use
    store.collect(quota_bytes=0, grace_s=0.0)
    assert keys(store) == set()
    record = record_of(store, value(7), key=key_of("b"))
    assert record.outputs["value"].object == published.object
    assert store.record(record) == record


def test_writers_wait_for_a_collector_and_a_collector_for_writers(store: Store) -> None:
    order: list[str] = []
    inside = threading.Event()

    def collector() -> None:
        with store.medium.collecting():
            order.append("alone")

    with store.medium.publishing():
        other = threading.Thread(target=collector)
        other.start()
        inside.wait(0.1)
        order.append("published")
    other.join()
    assert order == ["published", "alone"]


def test_collectors_beside_each_other(store: Store) -> None:
    for days in range(2, 12):
        did(store, f"k{days}", days, days_ago=days, label=str(days))
    threads = [
        threading.Thread(
            target=lambda: Store.open(store.path, durability="none").collect(quota_bytes=0)
        )
        for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert keys(store) == set()
    assert list(store.objects()) == []
    assert store.verify() == []


def test_records_that_name_a_removed_object_are_forgotten(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A bucket holds no writers off: one may record just while its old object is removed."""
    record = did(store, "a", days_ago=9)
    remove = type(store.medium).remove

    def late(medium: object, *digests: str) -> None:
        copied = dataclasses.replace(record, key=key_of("late"))
        store.medium.create(f"actions/{copied.key[3:5]}/{copied.key[5:]}.json", copied.to_bytes())
        remove(store.medium, *digests)

    monkeypatch.setattr(type(store.medium), "remove", late)
    store.collect(quota_bytes=0)
    assert store.verify() == []
    assert keys(store) == set()
