"""The store as a whole: opening, actions, listing, and disks that are full or read-only."""

from __future__ import annotations

import dataclasses
import errno
import json
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from storage import (
    ActionRecord,
    MissingArtifact,
    Output,
    SourceFile,
    Store,
    StoreFormatError,
    StoreFull,
    StoreMissing,
    StoreReadOnly,
)
from storage.bucket import object_prefix
from storage.digest import digest_value
from tests.storage.faulty import FaultyOs, disk
from tests.storage.media import behind, lose, on_any_medium
from tests.storage.samples import Scene, View, scene

SMALL = View("a.jpg", np.zeros((3, 4, 3), np.uint8), np.eye(3))


def record_of(store: Store, value: object = None, name: str = "k", **changes: Any) -> ActionRecord:
    published = store.publish(scene() if value is None else value)
    output = Output(published.object, published.content, published.kind, published.bytes)
    record = ActionRecord(
        key=digest_value(name, domain="test/1"),
        step="segment",
        scene="kitchen",
        label="bulldozer",
        outputs={"value": output},
        verdict={"status": "ok", "reasons": []},
        seconds={"compute": 1.0},
        peak_mb=1.0,
        started=time.time(),
        parts={"version": 1},
    )
    return dataclasses.replace(record, **changes)


def test_opening(tmp_path: Path) -> None:
    with pytest.raises(StoreMissing, match="no store at"):
        Store.open(tmp_path / "none", create=False)
    Store.open(tmp_path / "a" / "b")
    Store.open(tmp_path / "a" / "b", create=False)
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "a.jpg").write_text("")
    with pytest.raises(StoreFormatError, match="not empty and no store"):
        Store.open(tmp_path / "photos")
    (tmp_path / "a" / "b" / "store.json").write_text('{"format": 2, "hash": "blake3-256"}')
    with pytest.raises(StoreFormatError, match="knows only format 1"):
        Store.open(tmp_path / "a" / "b")


@on_any_medium
def test_recorded_actions_are_found(store: Store) -> None:
    record = record_of(store)
    assert store.lookup(record.key) == (None, "absent")
    assert store.record(record) == record
    assert store.lookup(record.key) == (record, "hit")
    store.remember_latest(record, "kitchen", "bulldozer")
    assert store.latest("kitchen", "segment", "bulldozer") == record
    assert store.latest("kitchen", "segment", "other") is None
    assert list(store.latest_of_scene("kitchen")) == [("segment", "bulldozer", record)]
    names = ["segment", "segment[bulldozer]", "kitchen/segment", record.key[:12]]
    for text in [*names, record.outputs["value"].object, record.outputs["value"].content[3:12]]:
        assert store.find(text) == [record], text
    assert store.find("seg") == []
    assert store.size() > 0


@on_any_medium
def test_write_once_first_action_wins_and_conflicts_are_kept(store: Store) -> None:
    first, second = record_of(store), record_of(store, SMALL)
    assert store.record(first) == first
    assert store.record(dataclasses.replace(first, host="other")) == first
    assert behind(store).names("conflicts/") == []
    assert store.record(second) == first
    [conflict] = behind(store).names("conflicts/")
    assert ActionRecord.from_bytes(behind(store).get(conflict)) == second
    assert store.lookup(first.key) == (first, "hit")


@on_any_medium
def test_no_dangling_action_without_its_object(store: Store) -> None:
    record = record_of(store)
    lose(store, record.outputs["value"].object)
    with pytest.raises(MissingArtifact):
        store.record(record)
    assert list(store.actions()) == []


@on_any_medium
def test_a_lost_object_makes_its_actions_misses(store: Store) -> None:
    record = store.record(record_of(store))
    lose(store, record.outputs["value"].object)
    assert len(store.verify()) == 1
    assert store.lookup(record.key, mend=False) == (None, "evicted")
    assert store.lookup(record.key) == (None, "evicted")
    assert store.lookup(record.key) == (None, "absent")
    assert store.verify() == []


@on_any_medium
def test_a_damaged_object_goes_to_quarantine_with_all_its_actions(store: Store) -> None:
    record = store.record(record_of(store))
    other = store.record(record_of(store, name="other"))
    behind(store).delete(object_prefix(record.outputs["value"].object) + "zarr.json")
    assert store.lookup(record.key, mend=False) == (None, "corrupt")
    assert store.lookup(record.key) == (None, "corrupt")
    assert store.lookup(other.key) == (None, "absent")
    assert behind(store).names("quarantine/") != []
    assert store.verify() == []


@on_any_medium
def test_derived_pointers_can_be_deleted(store: Store) -> None:
    """CATALOG-IS-DERIVED, as far as ``latest/`` goes."""
    record = store.record(record_of(store))
    store.remember_latest(record, "kitchen", "bulldozer")
    for name in behind(store).names("latest/"):
        behind(store).delete(name)
    assert store.lookup(record.key) == (record, "hit")
    assert store.latest("kitchen", "segment", "bulldozer") is None


@on_any_medium
def test_an_unreadable_action_counts_as_none(store: Store) -> None:
    record = store.record(record_of(store))
    [name] = behind(store).names("actions/")
    behind(store).put(name, b"{")
    assert len(store.verify()) == 1
    assert store.lookup(record.key) == (None, "absent")
    assert store.record(record) == record
    assert store.lookup(record.key) == (record, "hit")


DISKS = [
    (errno.ENOSPC, StoreFull, "free space there"),
    (errno.EROFS, StoreReadOnly, "cannot be written"),
    (errno.EDQUOT, StoreFull, "garden store gc"),
    (errno.EACCES, StoreReadOnly, "--store"),
]


def test_fail_loud_full_and_read_only_disks(tmp_path: Path) -> None:
    """Whichever call fails, the error is clear, nothing is half there, a rerun mends it."""
    probe = Store.open(tmp_path / "probe", durability="none")
    with disk(FaultyOs()) as counted:
        probe.record(record_of(probe, SMALL))
    removals = 1  # the record's draft is removed after the record counts
    for at in range(counted.calls - removals):
        code, error, word = DISKS[at % len(DISKS)]
        store = Store.open(tmp_path / "store", durability="none")
        with disk(FaultyOs(at, "error", code)), pytest.raises(error, match=word):
            store.record(record_of(store, SMALL))
        assert list(store.actions()) == []
        assert store.verify() == []
        store.record(record_of(store, SMALL))
        assert store.verify() == []
        shutil.rmtree(store.path)


def test_a_read_only_store_still_serves_hits(store: Store) -> None:
    record = store.record(record_of(store))
    with disk(FaultyOs(0, "error", errno.EROFS)):
        assert store.lookup(record.key) == (record, "hit")
        store.remember_latest(record, "kitchen", "x")
        assert isinstance(store.read(record.outputs["value"].object, Scene), Scene)


def test_staging_of_the_dead_is_swept_and_of_the_living_is_not(store: Store) -> None:
    code = (
        "import os, sys; from pathlib import Path; from storage import Store\n"
        "with Store.open(sys.argv[1]).scratch() as folder:\n"
        "    (folder / 'x').write_text('x'); os._exit(9)"
    )
    subprocess.run([sys.executable, "-c", code, str(store.path)], check=False)
    assert len(list((store.path / "tmp").iterdir())) == 1
    with store.scratch() as mine:
        assert [mine] == list((store.path / "tmp").iterdir())
        with Store.open(store.path).scratch():
            assert mine.is_dir()
    assert list((store.path / "tmp").iterdir()) == []


def test_source_files_count_by_content(tmp_path: Path) -> None:
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "photo.jpg").write_bytes(b"same")
    one, two = (SourceFile.of(tmp_path / f / "photo.jpg") for f in ("a", "b"))
    assert one == two
    assert one.path != two.path
    assert digest_value(one, domain="d") == digest_value(two, domain="d")
    (tmp_path / "b" / "photo.jpg").write_bytes(b"else")
    assert SourceFile.of(tmp_path / "b" / "photo.jpg") != one


@on_any_medium
def test_action_records_are_plain_json(store: Store) -> None:
    store.record(record_of(store))
    [name] = behind(store).names("actions/")
    document = json.loads(behind(store).get(name))
    assert document["format"] == 2
    assert document["outputs"]["value"]["kind"] == "Scene"
