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
from storage.digest import digest_bytes
from storage.manifest import Manifest
from tests.storage.samples import Scene, scene


def all_files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file())


def test_self_naming_and_sealed(store: Store) -> None:
    digest = store.publish(scene()).object
    folder = store.folder(digest)
    data = (folder / "manifest.json").read_bytes()
    assert digest_bytes(data) == digest
    assert folder.name == digest[5:]
    members = Manifest.from_bytes(data).members
    assert {str(p.relative_to(folder)) for p in all_files(folder)} == {*members, "manifest.json"}
    assert all(not path.stat().st_mode & 0o222 for path in all_files(folder))
    assert store.verify("full") == []


def test_write_once_publishing_again_changes_nothing(store: Store) -> None:
    first = store.publish(scene())
    before = {path: path.stat().st_mtime_ns for path in all_files(store.path / "objects")}
    assert store.publish(scene()) == first
    assert {p: p.stat().st_mtime_ns for p in all_files(store.path / "objects")} == before
    assert list((store.path / "tmp").iterdir()) == []


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


@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(st.data())
def test_hit_means_verified_no_flipped_bit_reaches_a_caller(
    store: Store, data: st.DataObject
) -> None:
    digest = store.publish(scene()).object
    path = data.draw(st.sampled_from(all_files(store.folder(digest))))
    original = path.read_bytes()
    bit = data.draw(st.integers(0, 8 * len(original) - 1))
    changed = bytearray(original)
    changed[bit // 8] ^= 1 << bit % 8
    path.chmod(0o644)
    path.write_bytes(bytes(changed))
    with pytest.raises(CorruptArtifact):
        store.read(digest, Scene)
    assert len(store.verify("full")) == 1
    path.write_bytes(original)
    store.read(digest, Scene)


@pytest.mark.parametrize("damage", ["truncated", "missing", "extra"])
def test_damaged_members_are_found_by_the_quick_check(store: Store, damage: str) -> None:
    digest = store.publish(scene()).object
    folder = store.folder(digest)
    for path in all_files(folder):
        original = path.read_bytes()
        path.chmod(0o644)
        if damage == "truncated":
            path.write_bytes(original[:-1])
        elif damage == "missing":
            path.unlink()
        else:
            (folder / "more").write_bytes(b"")
        assert len(store.verify("manifest")) == 1, path
        with pytest.raises(CorruptArtifact):
            store.read(digest, Scene)
        path.write_bytes(original)
        (folder / "more").unlink(missing_ok=True)
    assert store.verify("full") == []


def test_flips_inside_one_chunk_of_a_shard_are_found_by_partial_reads(store: Store) -> None:
    import numpy as np

    rng = np.random.default_rng(0)
    value = dataclasses.replace(scene(views=0), points=rng.random((400_000, 3)))
    digest = store.publish(value).object
    shard = store.folder(digest) / "points" / "c.0.0"
    data = bytearray(shard.read_bytes())
    data[100] ^= 1
    shard.chmod(0o644)
    shard.write_bytes(bytes(data))
    array, _place = store.read_array(digest, "points")
    assert np.array_equal(array[390_000:], value.points[390_000:])
    with pytest.raises(Exception, match=r"(?i)checksum"):
        array[:10]


def test_a_damaged_object_is_replaced_by_publishing_again(store: Store) -> None:
    digest = store.publish(scene()).object
    member = store.folder(digest) / "zarr.json"
    member.chmod(0o644)
    member.write_bytes(b"{}" + b" " * (member.stat().st_size - 2))
    assert store.publish(scene()).object == digest
    assert store.verify("full") == []
    assert len(list((store.path / "quarantine").iterdir())) == 1


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
