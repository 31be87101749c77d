"""Die, or lose power, at every call of a publish: no invariant breaks, a rerun converges."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from storage import Store
from tests.storage.faulty import FaultyOs, Killed, disk
from tests.storage.test_store import SMALL, record_of


def do_work(store: Store) -> str:
    record = store.record(record_of(store, SMALL))
    store.remember_latest(record, "kitchen", "bulldozer")
    return record.outputs["value"].content


def check(store: Store, expected: str) -> None:
    assert store.verify("full") == []
    for record in store.actions():
        assert store.lookup(record.key)[1] == "hit"
    assert do_work(Store.open(store.path, durability="none")) == expected
    assert store.verify("full") == []
    assert len(list(store.actions())) == 1
    assert len(list(store.objects())) == 1


def die_everywhere(tmp_path: Path, how: str, every: int) -> None:
    with disk(FaultyOs()) as counted:
        expected = do_work(Store.open(tmp_path / "whole"))
    assert counted.calls > 30
    for at in range(0, counted.calls, every):
        place = tmp_path / "store"
        with disk(FaultyOs(at, how)), pytest.raises(Killed):
            do_work(Store.open(place))
        check(Store.open(place), expected)
        shutil.rmtree(place)


@pytest.mark.parametrize("how", ["kill", "power"])
def test_sealed_and_no_dangling_at_some_calls(tmp_path: Path, how: str) -> None:
    die_everywhere(tmp_path, how, every=9)


@pytest.mark.slow
@pytest.mark.parametrize("how", ["kill", "power"])
def test_sealed_and_no_dangling_at_every_call(tmp_path: Path, how: str) -> None:
    die_everywhere(tmp_path, how, every=1)


@pytest.mark.parametrize("forgotten", ["members", "manifest", "folders"])
def test_the_shim_notices_a_missing_fsync(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, forgotten: str
) -> None:
    """Leave one kind of fsync out, and the test above would fail."""
    fsync = FaultyOs.fsync

    def lazy(self: FaultyOs, path: Path) -> None:
        kind = "folders" if path.is_dir() else "members"
        if (kind if path.name != "manifest.json" else "manifest") != forgotten:
            fsync(self, path)

    monkeypatch.setattr(FaultyOs, "fsync", lazy)
    store = Store.open(tmp_path / "store")
    faulty = FaultyOs()
    with disk(faulty):
        do_work(store)
    faulty.lose_power()
    assert not list(store.actions()) or store.verify("full") != []
