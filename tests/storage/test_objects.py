"""Objects: sealed, named by themselves, written once, verified whenever they are read."""

from __future__ import annotations

import dataclasses
import json
import threading
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from storage import CorruptArtifact, MissingArtifact, Store, StoreFormatError
from storage.bucket import object_prefix
from storage.digest import digest_bytes
from storage.manifest import Manifest
from tests.storage.media import behind, files_of, on_any_medium, on_any_medium_slowly
from tests.storage.samples import Scene, scene


@on_any_medium
def test_self_naming_and_sealed(store: Store) -> None:
    digest = store.publish(scene()).object
    place = f"objects/b3/{digest[3:5]}/{digest[5:]}/"
    data = behind(store).get(place + "manifest.json")
    assert digest_bytes(data) == digest
    members = Manifest.from_bytes(data).members
    names = {name.removeprefix(place) for name in behind(store).names(place)}
    assert names == {*members, "manifest.json"}
    assert store.verify("full") == []


def test_files_are_read_only_and_written_once(store: Store) -> None:
    def files() -> dict[Path, tuple[int, int]]:
        found = (path for path in (store.path / "objects").rglob("*") if path.is_file())
        return {path: (path.stat().st_mtime_ns, path.stat().st_mode & 0o222) for path in found}

    store.publish(scene())
    before = files()
    store.publish(scene())
    assert files() == before
    assert {writable for _time, writable in before.values()} == {0}


@on_any_medium
def test_write_once_publishing_again_changes_nothing(store: Store) -> None:
    first = store.publish(scene())
    before = behind(store).names("")
    assert store.publish(scene()) == first
    assert behind(store).names("") == before
    assert not [name for name in before if name.startswith("tmp/")]


@on_any_medium
def test_many_threads_publish_one_object(store: Store) -> None:
    found: list[str] = []
    threads = [
        threading.Thread(target=lambda: found.append(store.publish(scene()).object))
        for _ in range(6)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 6
    assert len(set(found)) == 1
    assert store.verify("full") == []


@on_any_medium_slowly
@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(st.data())
def test_hit_means_verified_no_flipped_bit_reaches_a_caller(
    store: Store, data: st.DataObject
) -> None:
    digest = store.publish(scene()).object
    name = data.draw(st.sampled_from(files_of(store, digest)))
    original = behind(store).get(name)
    bit = data.draw(st.integers(0, 8 * len(original) - 1))
    changed = bytearray(original)
    changed[bit // 8] ^= 1 << bit % 8
    behind(store).put(name, bytes(changed))
    with pytest.raises(CorruptArtifact):
        store.read(digest, Scene)
    assert len(store.verify("full")) == 1
    behind(store).put(name, original)
    store.read(digest, Scene)


@on_any_medium
@pytest.mark.parametrize("damage", ["truncated", "missing", "extra"])
def test_damaged_members_are_found_by_the_quick_check(store: Store, damage: str) -> None:
    digest = store.publish(scene()).object
    there = behind(store)
    for name in files_of(store, digest):
        if damage == "missing" and name.endswith("/manifest.json"):
            continue
        original = there.get(name)
        more = name.rpartition("/")[0] + "/more"
        if damage == "truncated":
            there.put(name, original[:-1])
        elif damage == "missing":
            there.delete(name)
        else:
            there.put(more, b"x")
        assert len(store.verify("manifest")) == 1, name
        with pytest.raises(CorruptArtifact):
            store.read(digest, Scene)
        there.put(name, original)
        if damage == "extra":
            there.delete(more)
    assert store.verify("full") == []


@on_any_medium
def test_flips_inside_one_chunk_of_a_shard_are_found_by_partial_reads(store: Store) -> None:
    import numpy as np

    rng = np.random.default_rng(0)
    value = dataclasses.replace(scene(views=0), points=rng.random((400_000, 3)))
    digest = store.publish(value).object
    [shard] = [name for name in files_of(store, digest) if name.endswith("/points/c.0.0")]
    data = bytearray(behind(store).get(shard))
    data[100] ^= 1
    behind(store).put(shard, bytes(data))
    array, _place = store.read_array(digest, "points")
    assert np.array_equal(array[390_000:], value.points[390_000:])
    with pytest.raises(Exception, match=r"(?i)checksum"):
        array[:10]


@on_any_medium
def test_a_damaged_object_is_replaced_by_publishing_again(store: Store) -> None:
    digest = store.publish(scene()).object
    root = object_prefix(digest) + "zarr.json"
    behind(store).put(root, b"{}")
    assert store.publish(scene()).object == digest
    assert store.verify("full") == []
    wards = {name.split("/")[1] for name in behind(store).names("quarantine/")}
    assert len(wards) == 1


@on_any_medium
def test_a_missing_object_says_so(store: Store) -> None:
    with pytest.raises(MissingArtifact, match="not in the store"):
        store.read("b3:" + "0" * 64, Scene)
    with pytest.raises(ValueError, match="not a digest"):
        store.read("b3:../../etc", Scene)


@pytest.mark.parametrize("path", ["../x", "/etc/passwd", "a/../../x", "a//b", "", "."])
def test_manifests_cannot_leave_their_object(path: str) -> None:
    document = {"format": 1, "kind": "k", "schema": "s", "content": "c", "members": {path: [0, ""]}}
    with pytest.raises(StoreFormatError, match="leave its object"):
        Manifest.from_bytes(json.dumps(document).encode())
