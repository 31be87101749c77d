"""CATALOG-IS-DERIVED: one table of all that was done, right whatever its files say."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest

from storage import Store, catalogue
from storage.catalogue import COLUMNS
from tests.storage.history import did, key_of, keys


@pytest.fixture(autouse=True)
def parts_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(catalogue, "_WORTH_A_PART", 2)


def parts(store: Store) -> list[Path]:
    return sorted((store.path / "catalog").glob("part-*.parquet"))


def from_records(store: Store) -> list[dict[str, Any]]:
    shutil.rmtree(store.path / "catalog", ignore_errors=True)
    return rows(store)


def rows(store: Store) -> list[dict[str, Any]]:
    return store.catalogue().to_pylist()


def test_a_row_says_what_the_record_says(store: Store) -> None:
    record = did(store, "a", 3, label="mug", why={"code": "new", "sentence": "x"})
    [row] = rows(store)
    assert list(row) == list(COLUMNS)
    output = record.outputs["value"]
    assert (row["key"], row["object"], row["content"]) == (
        record.key,
        output.object,
        output.content,
    )
    assert (row["scene"], row["step"], row["label"]) == ("kitchen", "segment", "mug")
    assert (row["status"], row["compute_s"], row["wait_s"]) == ("ok", 1.0, 0.0)
    assert (row["version"], row["why"], row["output"]) == (1, "new", "value")
    assert (row["bytes"], row["started"]) == (output.bytes, record.started)


def test_an_empty_store_has_an_empty_table(store: Store) -> None:
    assert store.catalogue().num_rows == 0
    assert store.catalogue().column_names == list(COLUMNS)


def test_catalog_is_derived_it_can_be_deleted_and_comes_back_equal(store: Store) -> None:
    for number in range(5):
        did(store, f"k{number}", number)
    first = rows(store)
    assert len(parts(store)) == 1
    assert len(first) == 5
    assert from_records(store) == first


def test_it_is_right_also_when_it_is_old(store: Store) -> None:
    for number in range(4):
        did(store, f"k{number}", number)
    rows(store)
    store.discard(store.action(key_of("k0")).outputs["value"].object)
    did(store, "new", 9)
    did(store, "k0", 7)  # again, and with another result
    found = rows(store)
    assert {row["key"] for row in found} == keys(store)
    assert found == from_records(store)


@pytest.mark.parametrize("damage", ["flip", "truncate", "empty", "rename", "foreign"])
def test_a_damaged_part_is_made_again(store: Store, damage: str) -> None:
    for number in range(4):
        did(store, f"k{number}", number)
    good = rows(store)
    [part] = parts(store)
    part.chmod(0o644)
    data = bytearray(part.read_bytes())
    if damage == "flip":
        data[len(data) // 2] ^= 4
    elif damage == "truncate":
        data = data[:-9]
    elif damage == "empty":
        data = bytearray()
    elif damage == "rename":
        part.rename(part.with_name("part-x.parquet"))
    else:
        part.with_name("notes.txt").write_text("mine")
    if damage in ("flip", "truncate", "empty"):
        part.write_bytes(bytes(data))
    assert rows(store) == good
    assert catalogue.damaged_parts(store.medium) == []
    assert rows(store) == good


def test_compaction_leaves_one_part_with_the_same_rows(store: Store) -> None:
    for number in range(6):
        did(store, f"k{number}", number)
        if number % 2:
            rows(store)
    assert len(parts(store)) == 3
    before = rows(store)
    store.discard(store.action(key_of("k0")).outputs["value"].object)
    assert store.compact() == 5
    assert len(parts(store)) == 1
    assert rows(store) == [row for row in before if row["key"] != key_of("k0")]
    assert store.compact() == 5
    assert len(parts(store)) == 1


def test_two_that_keep_the_same_rows_count_them_once(store: Store) -> None:
    for number in range(4):
        did(store, f"k{number}", number)
    rows(store)
    did(store, "k9", 9)
    kept = parts(store)[0].read_bytes()
    store.compact()
    (store.path / "catalog" / "part-x.parquet").write_bytes(kept)
    part = parts(store)[-1]
    part.rename(part.with_name(catalogue._part_name(kept).rpartition("/")[2]))
    assert len(rows(store)) == 5


def test_a_store_that_cannot_be_written_has_its_table(store: Store) -> None:
    import errno

    from tests.storage.faulty import FaultyOs, disk

    for number in range(4):
        did(store, f"k{number}", number)
    with disk(FaultyOs(0, "error", errno.EROFS)):
        assert len(rows(store)) == 4
    assert parts(store) == []
