"""Carry a store in a folder of a file system with link, rename and fsync."""

from __future__ import annotations

import errno
import fcntl
import os
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from storage import _os, staging
from storage.digest import digest_file, hexadecimal
from storage.errors import StoreError, StoreFormatError, explain_os_error
from storage.folder_leases import FolderLeases
from storage.leases import LEASE_S
from storage.manifest import MANIFEST
from storage.medium import Level
from storage.members import MemberWriter


class FolderMedium:
    """A store's folder. See ``Medium`` for what the methods promise."""

    recheck: Level = "full"
    readers = 1

    def __init__(self, path: Path, *, durable: bool = True, lease_s: float = LEASE_S) -> None:
        self.path = path
        self.address = str(path)
        self.durable = durable
        self.leases = FolderLeases(path, lease_s)
        self._swept = False

    def prepare(self) -> None:
        """Make the folder; StoreFormatError if it holds something else."""
        present = {p.name for p in self.path.iterdir()} if self.path.is_dir() else set()
        if present - {"tmp"}:
            raise StoreFormatError(f"{self.path} is not empty and no store: choose an empty folder")
        _os.ensure_folder(self.path, durable=self.durable)

    # -- documents ------------------------------------------------------------------------

    def read(self, name: str) -> bytes | None:
        """Return a document, None if there is none."""
        try:
            return (self.path / name).read_bytes()
        except FileNotFoundError:
            return None

    def create(self, name: str, data: bytes) -> bool:
        """Make a durable document at once; False if the name is taken."""
        target = self.path / name
        with staging.staging_folder(self.path, durable=False) as staged:
            draft = staged / target.name
            _os.active.write(draft, data)
            _os.active.chmod(draft, 0o444)
            if self.durable:
                _os.active.fsync(draft)
            _os.ensure_folder(target.parent, durable=self.durable)
            try:
                _os.active.link(draft, target)
            except FileExistsError:
                return False
            if self.durable:
                _os.active.fsync(target.parent)
        return True

    def replace(self, name: str, data: bytes) -> None:
        """Make or change a document at once."""
        target = self.path / name
        with staging.staging_folder(self.path, durable=False) as staged:
            draft = staged / target.name
            _os.active.write(draft, data)
            _os.ensure_folder(target.parent, durable=False)
            _os.active.rename(draft, target)

    def delete(self, name: str) -> None:
        """Remove a document."""
        try:
            _os.active.unlink(self.path / name)
        except FileNotFoundError:
            return

    def names(self, prefix: str) -> Iterator[str]:
        """Give the name of every document below a folder, sorted."""
        for name in sorted(file_sizes(self.path / prefix)):
            yield f"{prefix}{name}"

    # -- objects --------------------------------------------------------------------------

    def folder(self, digest: str) -> Path:
        """Return where the object of this digest stands."""
        name = hexadecimal(digest)
        return self.path / "objects" / "b3" / name[:2] / name[2:]

    @contextmanager
    def stage(self) -> Iterator[MemberWriter]:
        """Give a place for an object's members that nobody sees."""
        with self._staging() as staged:
            yield MemberWriter(staged, durable=self.durable)

    def seal(self, staged: MemberWriter, digest: str, manifest: bytes) -> bool:
        """Publish staged members by one rename; False if somebody else has."""
        _os.active.write(staged.folder / MANIFEST, manifest)
        if self.durable:
            _os.active.fsync(staged.folder / MANIFEST)
        for name in file_sizes(staged.folder):
            _os.active.chmod(staged.folder / name, 0o444)
        if self.durable:
            _sync_folders(staged.folder)
        target = self.folder(digest)
        _os.ensure_folder(target.parent, durable=self.durable)
        try:
            _os.active.rename(staged.folder, target)
        except OSError as error:
            if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
                raise
            return False
        if self.durable:
            _os.active.fsync(target.parent)
        return True

    def refresh(self, digest: str, manifest: bytes) -> None:
        """Do nothing: a collector is held off by ``publishing``, not by age."""

    def objects(self) -> Iterator[str]:
        """Give the digest of every object folder, sorted."""
        root = self.path / "objects" / "b3"
        if not root.is_dir():
            return
        for shelf in sorted(root.iterdir()):
            if len(shelf.name) == 2 and shelf.is_dir():
                for folder in sorted(shelf.iterdir()):
                    yield f"b3:{shelf.name}{folder.name}"

    def members(self, digest: str) -> dict[str, int]:
        """Return the files of an object and their bytes."""
        return file_sizes(self.folder(digest))

    def read_member(self, digest: str, path: str, start: int = 0, stop: int | None = None) -> bytes:
        """Return the bytes ``start:stop`` of a file of an object."""
        place = self.folder(digest) / path
        if start == 0 and stop is None:
            return place.read_bytes()
        descriptor = os.open(place, os.O_RDONLY | os.O_CLOEXEC)
        try:
            end = os.fstat(descriptor).st_size if stop is None else stop
            return os.pread(descriptor, end - start, start)
        finally:
            os.close(descriptor)

    def member_digest(self, digest: str, path: str) -> str:
        """Return the digest of a file of an object."""
        return digest_file(self.folder(digest) / path)

    def published_at(self, digest: str) -> float:
        """Return when an object was published."""
        return (self.folder(digest) / MANIFEST).stat().st_mtime

    def quarantine(self, digest: str) -> bool:
        """Move a damaged object out of the way for autopsy."""
        ward = self.path / "quarantine"
        _os.ensure_folder(ward, durable=True)
        return self._move_away(digest, ward / f"{hexadecimal(digest)}-{time.time_ns()}")

    def remove(self, digest: str) -> None:
        """Remove an object: one rename takes its name, then its files go."""
        _os.ensure_folder(self.path / "trash", durable=False)
        place = self.path / "trash" / uuid.uuid4().hex
        if self._move_away(digest, place):
            _os.remove_tree(place)

    def _move_away(self, digest: str, place: Path) -> bool:
        try:
            _os.active.rename(self.folder(digest), place)
        except FileNotFoundError:
            return False
        return True

    # -- room and order -------------------------------------------------------------------

    @contextmanager
    def publishing(self) -> Iterator[None]:
        """Hold off the collector while names are made."""
        with self._locked(fcntl.LOCK_SH):
            yield

    @contextmanager
    def collecting(self) -> Iterator[None]:
        """Be alone: nobody is publishing meanwhile."""
        with self._locked(fcntl.LOCK_EX):
            yield

    @contextmanager
    def scratch(self) -> Iterator[Path]:
        """Give a folder on the store's disk."""
        with self._staging() as folder:
            yield folder

    def sweep(self) -> int:
        """Remove staging folders of the dead, and what a dead collector left in the trash."""
        swept = staging.sweep(self.path)
        trash = self.path / "trash"
        for entry in list(trash.iterdir()) if trash.is_dir() else []:
            _os.remove_tree(entry)
            swept += 1
        return swept

    def explain(self, error: OSError) -> StoreError | None:
        """Return the store's own error for a full or read-only disk."""
        return explain_os_error(error, self.address)

    @contextmanager
    def _staging(self) -> Iterator[Path]:
        if not self._swept:
            self._swept = True
            staging.sweep(self.path)
        with staging.staging_folder(self.path, durable=False) as folder:
            yield folder

    @contextmanager
    def _locked(self, how: int) -> Iterator[None]:
        flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC
        descriptor = os.open(self.path / "gc.lock", flags, 0o644)
        try:
            fcntl.flock(descriptor, how)
            yield
        finally:
            os.close(descriptor)


def file_sizes(folder: Path, prefix: str = "") -> dict[str, int]:
    """Return the bytes of every file below a folder by its relative name."""
    sizes: dict[str, int] = {}
    try:
        entries = list(os.scandir(folder))
    except (FileNotFoundError, NotADirectoryError):
        return sizes
    for entry in entries:
        if entry.is_dir(follow_symlinks=False):
            sizes |= file_sizes(Path(entry.path), f"{prefix}{entry.name}/")
        else:
            sizes[prefix + entry.name] = entry.stat(follow_symlinks=False).st_size
    return sizes


def _sync_folders(folder: Path) -> None:
    for entry in os.scandir(folder):
        if entry.is_dir(follow_symlinks=False):
            _sync_folders(Path(entry.path))
    _os.active.fsync(folder)
