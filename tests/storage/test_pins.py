"""Pins: what is held stays, whoever collects; what a dead process held does not."""

from __future__ import annotations

import subprocess
import sys

import pytest

from storage import Store, StoreError
from storage.keep import Keep
from tests.storage.history import did, key_of, keys

ALL = Keep(unused_s=0.0, last=0, unrecorded_s=0.0)


def collect_all(store: Store) -> None:
    store.collect(grace_s=0.0, quota_bytes=0, keep=ALL)


@pytest.mark.parametrize("what", ["key", "object", "content"])
def test_a_pinned_digest_is_held_until_it_is_let_go(store: Store, what: str) -> None:
    record = did(store, "a", days_ago=9)
    output = record.outputs["value"]
    digest = {"key": record.key, "object": output.object, "content": output.content}[what]
    pin = store.pin("release-1", [digest], reason="the paper's figure 2")
    assert store.pins() == [pin]
    collect_all(store)
    assert store.lookup(record.key) == (record, "hit")
    assert store.unpin("release-1")
    assert not store.unpin("release-1")
    collect_all(store)
    assert keys(store) == set()
    assert list(store.objects()) == []


def test_a_pinned_scene_holds_what_it_stands_on_also_if_made_for_another(store: Store) -> None:
    own = did(store, "own", 1, days_ago=9)
    shared = did(store, "shared", 2, days_ago=9, scene="hall")
    did(store, "else", 3, days_ago=9, scene="hall", step="render")
    store.remember_latest(shared, "kitchen", "")
    store.pin("night", scenes=["kitchen"])
    collect_all(store)
    assert keys(store) == {own.key, shared.key}


@pytest.mark.parametrize("name", ["../x", "a/b", "", ".hidden", "a b", "x" * 101, "a\n"])
def test_names_are_plain_words(store: Store, name: str) -> None:
    with pytest.raises(StoreError, match="cannot name a pin"):
        store.pin(name, [key_of("a")])
    with pytest.raises(StoreError, match="cannot name a pin"):
        store.unpin(name)


def test_a_name_is_given_once_and_digests_are_whole(store: Store) -> None:
    store.pin("a", [key_of("a")])
    with pytest.raises(StoreError, match="a pin a already"):
        store.pin("a", [key_of("b")])
    with pytest.raises(StoreError, match="whole digests"):
        store.pin("b", ["b3:abc"])
    assert [pin.name for pin in store.pins()] == ["a"]


def test_locks_die_with_owners_a_dead_process_pins_nothing(store: Store) -> None:
    did(store, "a", days_ago=9)
    code = (
        "import os, sys; from storage import Store\n"
        "Store.open(sys.argv[1]).pin('run', scenes=['kitchen'], for_s=3600.0); os._exit(9)"
    )
    subprocess.run([sys.executable, "-c", code, str(store.path)], check=False)
    assert (store.path / "pins" / "run.json").exists()
    assert store.pins() == []
    collect_all(store)
    assert keys(store) == set()
    assert not (store.path / "pins" / "run.json").exists()


def test_a_living_process_pins_for_its_time(store: Store) -> None:
    record = did(store, "a", days_ago=9)
    store.pin("run", scenes=["kitchen"], for_s=3600.0)
    store.pin("late", for_s=0.0)
    collect_all(store)
    assert keys(store) == {record.key}
    assert [pin.name for pin in store.pins()] == ["run"]


def test_nothing_is_collected_while_a_pin_cannot_be_read(store: Store) -> None:
    record = did(store, "a", days_ago=9)
    store.pin("a", [record.key])
    place = store.path / "pins" / "a.json"
    place.chmod(0o644)
    place.write_text("{")
    with pytest.raises(StoreError, match="garden store repair"):
        collect_all(store)
    assert keys(store) == {record.key}
    [problem] = store.verify()
    assert problem.kind == "pin"
    store.repair()
    assert store.verify() == []
    assert len(list((store.path / "quarantine").rglob("a.json"))) == 1
