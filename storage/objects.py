"""Publish, verify and quarantine objects: folders sealed by a manifest.

An object stands under its final name only when it is whole and durable: members are
written and synchronised in staging, then the manifest, then the folders from the inside
out; one rename publishes all of it (invariants SEALED, SELF-NAMING, WRITE-ONCE).
"""

from __future__ import annotations

import errno
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from storage import _os
from storage.digest import digest_bytes, digest_file, hexadecimal
from storage.errors import CorruptArtifact, MissingArtifact, StoreFormatError
from storage.manifest import MANIFEST, Manifest

Level = Literal["manifest", "full"]


@dataclass(frozen=True)
class Published:
    """An object in the store. ``content`` is the digest of the value that it holds."""

    object: str
    content: str
    kind: str
    bytes: int


def object_folder(store: Path, digest: str) -> Path:
    """Return where the object of this digest stands."""
    name = hexadecimal(digest)
    return store / "objects" / "b3" / name[:2] / name[2:]


def seal(staged: Path, manifest: Manifest, store: Path, *, durable: bool) -> Published:
    """Publish the staged members under the manifest's digest.

    If the object is already there and whole, the staged copy is dropped; if what stands
    there is damaged, it goes to quarantine and the staged copy takes its place.
    """
    data = manifest.to_bytes()
    _os.active.write(staged / MANIFEST, data)
    digest = digest_bytes(data)
    if durable:
        _os.active.fsync(staged / MANIFEST)
    _protect(staged)
    if durable:
        _sync_folders(staged)
    target = object_folder(store, digest)
    _os.ensure_folder(target.parent, durable=durable)
    _move_into_place(staged, target, digest, store)
    if durable:
        _os.active.fsync(target.parent)
    return Published(digest, manifest.content, manifest.kind, manifest.size)


def _move_into_place(staged: Path, target: Path, digest: str, store: Path) -> None:
    if target.is_dir():
        try:
            verify(store, digest, "full")
        except (CorruptArtifact, MissingArtifact):
            quarantine(store, digest)
        else:
            return
    try:
        _os.active.rename(staged, target)
    except OSError as error:
        if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
            raise
        verify(store, digest, "full")  # somebody was faster


def read_manifest(store: Path, digest: str) -> Manifest:
    """Return an object's manifest, checked against the object's name.

    Raises:
        MissingArtifact: there is no such object.
        CorruptArtifact: the manifest is not the one that was published.
    """
    folder = object_folder(store, digest)
    try:
        data = (folder / MANIFEST).read_bytes()
    except FileNotFoundError:
        if folder.is_dir():
            raise CorruptArtifact(digest, "its manifest is missing") from None
        raise MissingArtifact(f"artifact {digest[:15]} is not in the store {store}") from None
    except OSError as error:
        raise CorruptArtifact(digest, f"its manifest cannot be read ({error})") from error
    if digest_bytes(data) != digest:
        raise CorruptArtifact(digest, "its manifest has changed")
    try:
        return Manifest.from_bytes(data)
    except StoreFormatError as error:
        raise CorruptArtifact(digest, str(error)) from error


def verify(store: Path, digest: str, level: Level) -> Manifest:
    """Check an object and return its manifest.

    ``manifest`` compares the set of members and their sizes, ``full`` hashes them too.

    Raises:
        MissingArtifact, CorruptArtifact: see ``read_manifest``.
    """
    manifest = read_manifest(store, digest)
    folder = object_folder(store, digest)
    present = dict(_members(folder))
    present.pop(MANIFEST, None)
    if missing := sorted(manifest.members.keys() - present.keys()):
        raise CorruptArtifact(digest, f"member {missing[0]} is missing")
    if extra := sorted(present.keys() - manifest.members.keys()):
        raise CorruptArtifact(digest, f"{extra[0]} is no member")
    for path, member in manifest.members.items():
        if present[path] != member.size:
            raise CorruptArtifact(
                digest, f"member {path} has {present[path]} bytes instead of {member.size}"
            )
    if level == "full":
        for path, member in manifest.members.items():
            if digest_file(folder / path) != member.digest:
                raise CorruptArtifact(digest, f"member {path} has changed")
    return manifest


def quarantine(store: Path, digest: str) -> Path | None:
    """Move a damaged object out of the way for autopsy; None if it was gone already."""
    folder = object_folder(store, digest)
    ward = store / "quarantine"
    _os.ensure_folder(ward, durable=True)
    place = ward / f"{hexadecimal(digest)}-{time.time_ns()}"
    try:
        _os.active.rename(folder, place)
    except FileNotFoundError:
        return None
    return place


def all_objects(store: Path) -> Iterator[str]:
    """Give the digest of every object folder."""
    root = store / "objects" / "b3"
    if not root.is_dir():
        return
    for shelf in sorted(root.iterdir()):
        if len(shelf.name) == 2 and shelf.is_dir():
            for folder in sorted(shelf.iterdir()):
                yield f"b3:{shelf.name}{folder.name}"


def _members(folder: Path, prefix: str = "") -> Iterator[tuple[str, int]]:
    for entry in os.scandir(folder):
        name = prefix + entry.name
        if entry.is_dir(follow_symlinks=False):
            yield from _members(Path(entry.path), name + "/")
        else:
            yield name, entry.stat(follow_symlinks=False).st_size


def _protect(folder: Path) -> None:
    for path, _size in list(_members(folder)):
        _os.active.chmod(folder / path, 0o444)


def _sync_folders(folder: Path) -> None:
    for entry in os.scandir(folder):
        if entry.is_dir(follow_symlinks=False):
            _sync_folders(Path(entry.path))
    _os.active.fsync(folder)
