"""Carry a store in a folder of a file system with link, rename and fsync."""

from __future__ import annotations

import errno
import os
import re
import time
import uuid
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path

from storage import _os, locks, staging
from storage.digest import digest_file, hexadecimal
from storage.errors import StoreError, StoreFormatError, explain_os_error
from storage.folder_leases import FolderLeases
from storage.leases import LEASE_S
from storage.manifest import MANIFEST
from storage.medium import Level
from storage.members import MemberWriter
from storage.read_cache import ReadCache

_YOUNG_S = 3600.0
_LISTED = re.compile(r"[^/]{2}(?!\.\.?$)[^/\0]+")


class FolderMedium:
    """A store's folder. See ``Medium`` for what the methods promise."""

    recheck: Level = "full"
    readers = 1
    cache: ReadCache | None = None

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
            return _read(f"{self.address}/{name}")
        except FileNotFoundError:
            return None

    def create(self, name: str, data: bytes) -> bool:
        """Make a durable document at once; False if the name is taken."""
        target = self.path / name
        with staging.staged_file(self.path, data) as draft:
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
        with staging.staged_file(self.path, data) as draft:
            _os.ensure_folder(target.parent, durable=False)
            _os.active.rename(draft, target)

    def delete(self, *names: str) -> None:
        """Remove documents; each folder is synchronised once."""
        folders = set()
        for name in names:
            place = self.path / name
            with suppress(FileNotFoundError):
                _os.active.unlink(place)
                folders.add(place.parent)
        self._sync(folders)

    def clear(self, prefix: str) -> None:
        """Remove a folder and all below it."""
        _os.remove_tree(self.path / prefix)

    def touch(self, name: str) -> None:
        """Make an empty document, or make it young again."""
        place = f"{self.path}/{name}"
        with suppress(OSError):
            try:
                written = os.stat(place).st_mtime  # noqa: PTH116 (every hit pays for this)
            except FileNotFoundError:
                _os.ensure_folder(Path(place).parent, durable=False)
                _os.active.write(Path(place), b"")
                return
            if time.time() - written > _YOUNG_S:
                _os.active.touch(Path(place))

    def names(self, prefix: str) -> Iterator[str]:
        """Give the name of every document below a folder, sorted."""
        for name in sorted(file_sizes(self.path / prefix)):
            yield f"{prefix}{name}"

    def times(self, prefix: str) -> Iterator[tuple[str, float]]:
        """Give the name of every document below a folder, and when it was last written."""
        for name, entry in files_below(self.path / prefix, prefix).items():
            with suppress(FileNotFoundError):
                yield name, entry.stat(follow_symlinks=False).st_mtime

    # -- objects --------------------------------------------------------------------------

    def _place(self, digest: str) -> str:
        """Return the same as ``folder`` does; every hit pays for this."""
        name = hexadecimal(digest)
        return f"{self.address}/objects/b3/{name[:2]}/{name[2:]}"

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
        if not self._take_name(staged.folder, target):
            return False
        if self.durable:
            _os.active.fsync(target.parent)
        return True

    def _take_name(self, staged: Path, target: Path) -> bool:
        """Rename what is staged; False if an object stands there. Empty folders are none."""
        for _try in range(2):
            try:
                _os.active.rename(staged, target)
            except OSError as error:
                if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
                    raise
            else:
                return True
            if file_sizes(target):
                return False
            self._move_away([target], "trash", uuid.uuid4().hex)
        return False

    def refresh(self, digest: str, manifest: bytes) -> None:
        """Make an object young again if it is older than an hour and not another user's."""
        with suppress(PermissionError):
            if time.time() - self.published_at(digest) > _YOUNG_S:
                _os.active.touch(self.folder(digest) / MANIFEST)

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
        return file_sizes(self._place(digest))

    def read_member(self, digest: str, path: str, start: int = 0, stop: int | None = None) -> bytes:
        """Return the bytes ``start:stop`` of a file of an object."""
        return _read(f"{self._place(digest)}/{path}", start, stop)

    def member_digest(self, digest: str, path: str) -> str:
        """Return the digest of a file of an object."""
        return digest_file(self.folder(digest) / path)

    def published_at(self, digest: str) -> float:
        """Return when an object was published."""
        return (self.folder(digest) / MANIFEST).stat().st_mtime

    def quarantine(self, digest: str) -> bool:
        """Move a damaged object out of the way for autopsy."""
        name = digest.removeprefix("b3:")
        if not _LISTED.fullmatch(name):  # whatever ``objects`` gives, also if it is no digest
            hexadecimal(digest)
        folder = self.path / "objects" / "b3" / name[:2] / name[2:]
        return self._move_away([folder], "quarantine", f"{name}-{time.time_ns()}") > 0

    def remove(self, *digests: str) -> None:
        """Take the objects' names by a rename each; ``sweep`` removes their files."""
        self._move_away([self.folder(digest) for digest in digests], "trash", uuid.uuid4().hex)

    def _move_away(self, folders: list[Path], where: str, name: str) -> int:
        """Move folders below ``where``; each shelf that loses one is synchronised once."""
        ward = self.path / where
        _os.ensure_folder(ward, durable=True)
        shelves = []
        for number, folder in enumerate(folders):
            with suppress(FileNotFoundError):
                _os.active.rename(folder, ward / (f"{name}-{number}" if number else name))
                shelves.append(folder.parent)
        self._sync(set(shelves))
        return len(shelves)

    def _sync(self, folders: Iterable[Path]) -> None:
        if self.durable:
            for folder in sorted(folders):
                _os.active.fsync(folder)

    # -- room and order -------------------------------------------------------------------

    def publishing(self) -> AbstractContextManager[None]:
        """Hold off the collector while names are made."""
        return locks.shared(self.path / "gc.lock")

    def collecting(self) -> AbstractContextManager[None]:
        """Be alone: nobody is publishing meanwhile."""
        return locks.alone(self.path / "gc.lock")

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
        with staging.staging_folder(self.path) as folder:
            yield folder


def _read(place: str, start: int = 0, stop: int | None = None) -> bytes:
    """Return the bytes ``start:stop`` of a file with as few calls as it takes."""
    descriptor = os.open(place, os.O_RDONLY | os.O_CLOEXEC)
    try:
        end = os.fstat(descriptor).st_size if stop is None else stop
        pieces = []
        while start < end and (piece := os.pread(descriptor, end - start, start)):
            pieces.append(piece)
            start += len(piece)
        return pieces[0] if len(pieces) == 1 else b"".join(pieces)
    finally:
        os.close(descriptor)


def files_below(folder: Path | str, prefix: str = "") -> dict[str, os.DirEntry[str]]:
    """Return every file below a folder by its relative name, in a stable order."""
    found: dict[str, os.DirEntry[str]] = {}
    _add_files(os.fspath(folder), prefix, found)
    return found


def _add_files(folder: str, prefix: str, found: dict[str, os.DirEntry[str]]) -> None:
    try:
        entries = sorted(os.scandir(folder), key=lambda entry: entry.name)
    except (FileNotFoundError, NotADirectoryError):
        return
    for entry in entries:
        if entry.is_dir(follow_symlinks=False):
            _add_files(entry.path, f"{prefix}{entry.name}/", found)
        else:
            found[prefix + entry.name] = entry


def file_sizes(folder: Path | str) -> dict[str, int]:
    """Return the bytes of every file below a folder by its relative name."""
    sizes: dict[str, int] = {}
    for name, entry in files_below(folder).items():
        with suppress(FileNotFoundError):
            sizes[name] = entry.stat(follow_symlinks=False).st_size
    return sizes


def _sync_folders(folder: Path) -> None:
    for entry in os.scandir(folder):
        if entry.is_dir(follow_symlinks=False):
            _sync_folders(Path(entry.path))
    _os.active.fsync(folder)
