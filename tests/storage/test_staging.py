"""A staging folder is removed at the end, and never in the way of what went wrong."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from storage import Store, _os
from storage.staging import staged_file, staging_folder, sweep
from tests.storage.faulty import FaultyOs, disk
from tests.storage.test_store import record_of


def test_it_is_gone_afterwards(tmp_path: Path) -> None:
    with staging_folder(tmp_path) as folder:
        (folder / "file").write_text("x")
    assert list((tmp_path / "tmp").iterdir()) == []


def test_it_is_gone_after_an_error(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), staging_folder(tmp_path):
        raise RuntimeError
    assert list((tmp_path / "tmp").iterdir()) == []


def test_ctrl_c_is_heard_even_if_the_folder_cannot_be_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A child that is just being killed may still write into it."""

    def fails(path: Path) -> None:
        raise OSError(39, "Directory not empty")

    with pytest.raises(KeyboardInterrupt), staging_folder(tmp_path):
        monkeypatch.setattr(_os, "remove_tree", fails)
        raise KeyboardInterrupt


def test_what_is_published_leaves_nothing_to_remove(store: Store) -> None:
    """Freed inodes make a file system slower at finding the next ones for minutes."""
    with store.medium.publishing():  # makes the locks
        before = len(list(store.path.rglob("*")))
    with disk(FaultyOs()) as counted:
        record = record_of(store)
        store.record(record)
        store.remember_latest(record, "kitchen", "bulldozer")
    made = Counter(counted.operations)
    assert made["write"] + made["mkdir"] == len(list(store.path.rglob("*"))) - before


def test_what_was_left_is_swept_by_its_name(tmp_path: Path) -> None:
    """Also a file, and also what was left before this machine was started again."""
    with staging_folder(tmp_path) as mine, staged_file(tmp_path, b"x") as draft:
        host, boot, space, pid, started = mine.name.partition("-")[2].split("-")
        for other in (
            f"1-{host}-{boot}-{space}-{pid}-{int(started) + 1}",
            f"2-{host}-{'0' * len(boot)}-{space}-{pid}-{started}",
        ):
            (tmp_path / "tmp" / other).write_bytes(b"x")
        stay = {
            f"3-{'0' * len(host)}-{'0' * len(boot)}-{space}-{pid}-{started}",
            f"4-{host}-{boot}-{'0' * len(space)}-{pid}-{int(started) + 1}",
            "5-somebody-else",
        }
        for other in stay:
            (tmp_path / "tmp" / other).write_bytes(b"x")
        assert sweep(tmp_path) == 2
        assert {path.name for path in (tmp_path / "tmp").iterdir()} - stay == {
            mine.name,
            draft.name,
        }
