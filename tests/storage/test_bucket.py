"""A store in a bucket: the manifest is the moment of publication, and requests are few."""

from __future__ import annotations

import dataclasses
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from storage import MissingArtifact, Store, StoreFormatError, StoreMissing, StoreReadOnly
from storage.bucket import BucketMedium, object_prefix
from storage.bucket_client import BucketClient
from storage.digest import digest_value
from storage.manifest import Manifest
from storage.members import MemberWriter
from tests.s3_server import BUCKET, S3Server
from tests.storage.media import behind, files_of
from tests.storage.samples import Scene, same, scene
from tests.storage.test_store import record_of

KEY = digest_value("key", domain="test/1")
IN_A_BUCKET = pytest.mark.parametrize("store", ["bucket"], indirect=True)


def bucket_of(store: Store) -> BucketMedium:
    assert isinstance(store.medium, BucketMedium)
    return store.medium


def names(requests: list[dict[str, Any]], method: str) -> list[str]:
    return [request["path"] for request in requests if request["method"] == method]


def test_opening(s3: S3Server) -> None:
    place = f"s3://{BUCKET}/opening"
    with pytest.raises(StoreMissing, match="no store at s3://"):
        Store.open(place, create=False)
    Store.open(place)
    assert Store.open(place + "/", create=False).address == place
    s3.put("photos/a.jpg", b"x")
    with pytest.raises(StoreFormatError, match=r"holds a\.jpg and is no store"):
        Store.open(f"s3://{BUCKET}/photos")
    s3.put("opening/store.json", b'{"format": 2, "hash": "blake3-256"}')
    with pytest.raises(StoreFormatError, match="knows only format 1"):
        Store.open(place)
    for create in (True, False):
        with pytest.raises(StoreMissing, match="no bucket for the store s3://elsewhere/x"):
            Store.open("s3://elsewhere/x", create=create)


@IN_A_BUCKET
def test_sealed_the_manifest_comes_last_and_only_where_there_is_none(
    store: Store, s3: S3Server
) -> None:
    s3.counted()
    digest = store.publish(scene()).object
    puts = names(s3.counted(), "PUT")
    assert puts[-1].endswith("/manifest.json")
    assert len(puts) == len(store.manifest(digest).members) + 1
    s3.counted()
    store.publish(scene())
    assert names(s3.counted(), "PUT") == []


@IN_A_BUCKET
def test_members_without_a_manifest_are_no_object(store: Store) -> None:
    digest = store.publish(scene()).object
    behind(store).delete(object_prefix(digest) + "manifest.json")
    assert list(store.objects()) == []
    assert store.medium.members(digest) == {}
    with pytest.raises(MissingArtifact):
        store.read(digest, Scene)
    assert store.publish(scene()).object == digest
    assert same(store.read(digest, Scene), scene())


@IN_A_BUCKET
def test_a_verified_look_up_is_three_requests(store: Store, s3: S3Server) -> None:
    record = store.record(record_of(store))
    s3.counted()
    assert store.lookup(record.key) == (record, "hit")
    assert len(s3.counted()) == 3
    assert store.lookup(KEY) == (None, "absent")
    assert len(s3.counted()) == 1


@IN_A_BUCKET
def test_a_slice_is_read_without_the_rest(store: Store, s3: S3Server) -> None:
    points = np.random.default_rng(0).random((600_000, 3))  # 14 MB in one shard
    digest = store.publish(dataclasses.replace(scene(views=0), points=points)).object
    s3.counted()
    array, _place = store.read_array(digest, "points")
    assert np.array_equal(array[300_000:300_010], points[300_000:300_010])
    requests = s3.counted()
    assert len(requests) <= 6  # manifest, list, two of metadata, the shard's index, one chunk
    assert sum(request["sent"] for request in requests) < 1.2e6


@IN_A_BUCKET
def test_fields_are_read_without_the_others(store: Store, s3: S3Server) -> None:
    digest = store.publish(scene()).object
    s3.counted()
    assert store.read_fields(digest, Scene, ("notes", "scores"))["notes"] == ("one", "")
    asked = names(s3.counted(), "GET")
    assert [path.rpartition("/")[2] for path in asked] == ["manifest.json", BUCKET, "zarr.json"]
    store.read_fields(digest, Scene, ("blob",))
    assert sum("/blobs/" in path for path in names(s3.counted(), "GET")) == 1


@IN_A_BUCKET
def test_a_whole_value_is_read_at_once_and_every_member_once(store: Store, s3: S3Server) -> None:
    digest = store.publish(scene()).object
    s3.counted()
    s3.fail(5, method="GET", path="/objects/", status=200, delay=0.2)
    assert same(store.read(digest, Scene), scene())
    requests = s3.counted()
    asked = [path for path in names(requests, "GET") if "/objects/" in path]
    assert sorted(asked) == sorted(set(asked))
    assert max(request["at_once"] for request in requests) >= 4


@IN_A_BUCKET
def test_a_damaged_object_is_kept_for_autopsy_and_made_again(store: Store) -> None:
    record = store.record(record_of(store))
    digest = record.outputs["value"].object
    root = object_prefix(digest) + "zarr.json"
    behind(store).put(root, b"{}")
    assert store.lookup(record.key) == (None, "corrupt")
    [ward] = [
        name
        for name in behind(store).names("quarantine/")
        if name.count("/") == 2 and name.endswith("/zarr.json")
    ]
    assert behind(store).get(ward) == b"{}"
    assert store.record(record_of(store)).outputs["value"].object == digest
    assert same(store.read(digest, Scene), scene())
    assert store.verify("full") == []


@IN_A_BUCKET
def test_a_member_that_is_removed_during_the_upload_is_put_again(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    create = BucketClient.create

    def swept(client: BucketClient, name: str, data: bytes) -> Any:
        if name.endswith("/manifest.json"):
            client.delete([name.replace("manifest.json", "zarr.json")])
        return create(client, name, data)

    monkeypatch.setattr(BucketClient, "create", swept)
    digest = store.publish(scene()).object
    assert store.verify("full") == []
    assert same(store.read(digest, Scene), scene())


@IN_A_BUCKET
def test_orphans_only_what_was_left_unfinished_is_swept_after_a_day(
    store: Store, s3: S3Server
) -> None:
    record = store.record(record_of(store))
    left = store.publish(scene(1)).object
    behind(store).delete(object_prefix(left) + "manifest.json")
    lease = store.acquire(KEY)
    assert lease is not None
    store.leases.abandon_all()
    assert store.medium.sweep() == 0
    s3.age(hours=25)
    fresh = store.publish(scene(2)).object
    behind(store).delete(object_prefix(fresh) + "manifest.json")
    assert store.medium.sweep() == 2
    assert files_of(store, left) == []
    assert behind(store).names("leases/") == []
    assert files_of(store, fresh) != []
    assert store.lookup(record.key) == (record, "hit")
    assert store.verify("full") == []


@IN_A_BUCKET
def test_what_is_published_again_is_young_again(store: Store, s3: S3Server) -> None:
    digest = store.publish(scene()).object
    s3.age(hours=48)
    old = store.medium.published_at(digest)
    store.publish(scene())
    assert store.medium.published_at(digest) - old > 47 * 3600
    with pytest.raises(FileNotFoundError):
        store.medium.published_at(KEY)


@IN_A_BUCKET
def test_a_removed_object_is_gone(store: Store) -> None:
    keep, digest = store.publish(scene(1)).object, store.publish(scene()).object
    store.medium.remove(digest)
    assert files_of(store, digest) == []
    assert [found for found, _size in store.objects()] == [keep]
    store.medium.remove(digest)


@IN_A_BUCKET
def test_documents_are_created_once_listed_and_removed(store: Store) -> None:
    medium = store.medium
    assert medium.create("pins/b/x.json", b"1")
    assert not medium.create("pins/b/x.json", b"1")
    assert medium.create("pins/a.json", b"2")
    assert medium.create("pinsel/c.json", b"3")
    assert list(medium.names("pins/")) == ["pins/a.json", "pins/b/x.json"]
    medium.replace("pins/a.json", b"4")
    assert medium.read("pins/a.json") == b"4"
    medium.delete("pins/a.json")
    medium.delete("pins/a.json")
    assert medium.read("pins/a.json") is None


@IN_A_BUCKET
def test_parts_of_members(store: Store) -> None:
    digest = store.publish(b"0123456789" * 600).object
    [path] = [p for p in store.medium.members(digest) if p.startswith("blobs/")]
    whole = store.medium.read_member(digest, path)
    assert store.medium.read_member(digest, path, 10, 20) == whole[10:20]
    assert store.medium.read_member(digest, path, 5990) == whole[5990:]
    assert store.medium.read_member(digest, path, 5990, 9000) == whole[5990:]
    assert store.medium.read_member(digest, path, 7000, 7001) == b""
    assert store.medium.read_member(digest, path, 5, 5) == b""
    assert store.medium.member_digest(digest, path) == store.manifest(digest).members[path].digest


@IN_A_BUCKET
def test_a_large_member_is_uploaded_in_parts(store: Store, s3: S3Server) -> None:
    data = os.urandom(20 << 20)
    s3.counted()
    digest = store.publish(data).object
    parts = [path for path in names(s3.counted(), "PUT") if "/blobs/" in path]
    assert len(parts) == 3
    assert store.read_as(digest, bytes) == data


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    yield tmp_path


@IN_A_BUCKET
def test_work_is_done_in_a_temporary_folder_of_ones_own(store: Store, temporary: Path) -> None:
    with store.scratch() as folder:
        (folder / "x").write_text("x")
        assert folder.is_relative_to(temporary)
        assert not (temporary / f"garden-{os.getuid()}").stat().st_mode & 0o077
    assert not folder.exists()


@IN_A_BUCKET
def test_a_temporary_folder_that_others_may_change_is_refused(
    store: Store, temporary: Path
) -> None:
    room = temporary / f"garden-{os.getuid()}"
    (temporary / "elsewhere").mkdir()
    room.symlink_to(temporary / "elsewhere")
    with pytest.raises(StoreReadOnly, match="TMPDIR"):
        store.publish(scene())
    assert list(store.objects()) == []


@IN_A_BUCKET
def test_write_once_of_two_writers_the_first_stays(store: Store) -> None:
    """Both find nothing, both upload; the second hears that it was not the first."""
    medium = bucket_of(store)
    with medium.stage() as one, medium.stage() as two:
        manifests = [_staged(staged) for staged in (one, two)]
        assert manifests[0] == manifests[1]
        digest = manifests[0].digest
        assert medium.seal(one, digest, manifests[0].to_bytes())
        assert not medium.seal(two, digest, manifests[1].to_bytes())
    assert store.verify("full") == []


def _staged(members: MemberWriter) -> Manifest:
    from storage.codec.values import write_value

    return write_value(scene(), members)
