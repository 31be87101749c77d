"""Members of a bucket are kept on this machine, verified and bounded."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from storage import Store, StoreFormatError, StoreReadOnly
from storage.bucket import object_prefix
from storage.digest import digest_bytes
from storage.read_cache import ReadCache
from tests.s3_server import S3Server
from tests.storage.faulty import FaultyOs, disk
from tests.storage.media import behind
from tests.storage.samples import Scene, same, scene
from tests.storage.test_bucket import IN_A_BUCKET


def named(data: bytes) -> str:
    return digest_bytes(data)


@pytest.fixture
def cached(store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Store:
    monkeypatch.setenv("GARDEN_CACHE", str(tmp_path / "cache"))
    return Store.open(store.address)


@IN_A_BUCKET
def test_a_value_is_fetched_once(store: Store, cached: Store, s3: S3Server) -> None:
    digest = store.publish(scene()).object  # by a machine of other cache
    assert same(cached.read(digest, Scene), scene())
    s3.counted()
    assert same(cached.read(digest, Scene), scene())
    asked = [request["path"].rpartition("/")[2] for request in s3.counted()]
    assert asked == ["manifest.json", "garden"]


@IN_A_BUCKET
def test_what_was_published_here_is_not_fetched(cached: Store, s3: S3Server) -> None:
    digest = cached.publish(scene()).object
    s3.counted()
    assert same(cached.read(digest, Scene), scene())
    assert len(s3.counted()) == 2


@IN_A_BUCKET
def test_hit_means_verified_a_changed_file_is_fetched_again(
    store: Store, cached: Store, tmp_path: Path
) -> None:
    digest = cached.publish(scene()).object
    files = [path for path in (tmp_path / "cache").rglob("*") if path.is_file()]
    assert len(files) == len({m.digest for m in store.manifest(digest).members.values()})
    for path in files:
        path.write_bytes(path.read_bytes()[:-1] + b"?")
    assert same(cached.read(digest, Scene), scene())
    assert same(cached.read(digest, Scene), scene())
    assert behind(store).names("quarantine/") == []


@IN_A_BUCKET
def test_a_damaged_member_in_the_bucket_is_still_found_by_a_full_check(
    store: Store, cached: Store
) -> None:
    digest = cached.publish(scene()).object
    root = object_prefix(digest) + "zarr.json"
    behind(store).put(root, behind(store).get(root)[::-1])
    assert cached.verify("manifest") == []
    assert len(cached.verify("full")) == 1


def test_the_longest_unread_goes_and_the_limit_holds(tmp_path: Path) -> None:
    cache = ReadCache(tmp_path, limit=1000)
    pieces = [bytes([i]) * 100 for i in range(30)]
    for i, piece in enumerate(pieces):
        cache.put(named(piece), piece)
        os.utime(next(p for p in tmp_path.rglob(named(piece)[5:])), (i, i))
        assert sum(p.stat().st_size for p in tmp_path.rglob("*") if p.is_file()) <= 1000
    assert cache.get(named(pieces[-1])) == pieces[-1]
    assert cache.get(named(pieces[0])) is None
    cache.put(named(b"x" * 500), b"x" * 500)
    assert cache.get(named(b"x" * 500)) is None  # one that would push most others out


def test_a_full_disk_costs_nothing_but_speed(tmp_path: Path) -> None:
    cache = ReadCache(tmp_path, limit=1000)
    with disk(FaultyOs(0, "error", 28)):
        cache.put(named(b"x"), b"x")
    assert cache.get(named(b"x")) is None
    assert [p for p in tmp_path.rglob("*") if p.is_file()] == []


def test_settings_that_make_no_sense_are_refused(tmp_path: Path) -> None:
    assert ReadCache.of({}) is None
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreReadOnly, match="unset GARDEN_CACHE"):
        ReadCache.of({"GARDEN_CACHE": str(tmp_path / "file" / "cache")})
    for size in ("0", "-1", "much", "inf"):
        with pytest.raises(StoreFormatError, match="GARDEN_CACHE_GB"):
            ReadCache.of({"GARDEN_CACHE": str(tmp_path), "GARDEN_CACHE_GB": size})
