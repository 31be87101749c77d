"""Unpack a capture's archive (zip, tar, tar.gz) into a folder, and nothing outside it.

An archive with a name that leads out, a link, a device, or more data than limits allow is
refused as a whole. Only photos, videos and files of cameras and targets are taken out.
"""

from __future__ import annotations

import contextlib
import gzip
import stat
import tarfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Literal, cast

from storage.formats import photos, video
from storage.formats.archive_name import MAX_BYTES
from storage.formats.errors import UnreadableInput
from storage.formats.limits import check_file_size, in_words
from storage.formats.member_name import is_inside

TAKEN = (*photos.SUFFIXES, *video.SUFFIXES, ".json", ".bin", ".txt")
MAX_MEMBERS = 20_000
MAX_RATIO = 100
"""Unpacked to packed size; photos and videos hardly become smaller."""

RATIO_FROM = 100_000_000  # bytes; below it the ratio does not matter
_BLOCK = 1 << 20


@dataclass(frozen=True)
class _Member:
    name: str
    size: int  # bytes, as the archive says
    kind: Literal["file", "folder", "link or device", "encrypted file"]
    open: Callable[[], IO[bytes]]


def unpack(archive: Path, folder: Path) -> None:
    """Unpack ``archive`` into the new folder ``folder``.

    Raises:
        UnreadableInput: it is damaged, or breaks a rule or a limit; what was unpacked so
            far stays for the caller to remove.
        OSError: the files cannot be written.
    """
    check_file_size(archive, MAX_BYTES, "an archive")
    packed = archive.stat().st_size
    room = min(MAX_BYTES, max(RATIO_FROM, MAX_RATIO * packed))
    folder.mkdir(mode=0o700, parents=True)
    with _explained(archive), _members(archive) as members:
        for count, member in enumerate(members, start=1):
            _check(archive, member, count, room)
            if member.kind == "file" and _is_taken(member.name):
                room -= _copy(archive, member, folder / member.name, room)


def _check(archive: Path, member: _Member, count: int, room: int) -> None:
    if count > MAX_MEMBERS:
        raise _refused(archive, f"it holds more than {MAX_MEMBERS} files")
    if not is_inside(member.name):
        raise _refused(archive, f"its file {member.name!r} would be put outside the folder")
    if member.kind not in ("file", "folder"):
        raise _refused(archive, f"{member.name!r} in it is a {member.kind}")
    if member.size > room:
        raise _too_much(archive)


def _is_taken(name: str) -> bool:
    hidden = any(part.startswith(".") or part == "__MACOSX" for part in name.split("/"))
    return not hidden and name.lower().endswith(TAKEN)


def _copy(archive: Path, member: _Member, target: Path, room: int) -> int:
    """Write a member's bytes, counting them: a header may say less. Return their number."""
    written = 0
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        out = target.open("xb")
    except (FileExistsError, NotADirectoryError, IsADirectoryError):
        raise _refused(archive, f"it holds {member.name!r} twice") from None
    with out, member.open() as source:
        while block := source.read(_BLOCK):
            written += len(block)
            if written > room:
                raise _too_much(archive)
            out.write(block)
    return written


@contextmanager
def _members(archive: Path) -> Iterator[Iterator[_Member]]:
    if archive.name.lower().endswith(".zip"):
        with zipfile.ZipFile(archive) as opened:
            yield (_zip_member(opened, info) for info in opened.infolist())
        return
    with contextlib.ExitStack() as stack:
        raw = stack.enter_context(archive.open("rb"))
        plain: Any = raw
        if not archive.name.lower().endswith(".tar"):
            plain = stack.enter_context(gzip.GzipFile(fileobj=raw, mode="rb"))
        bounded = cast(IO[bytes], _Bounded(plain))
        tar = stack.enter_context(tarfile.open(fileobj=bounded, mode="r:"))
        yield (_tar_member(tar, info) for info in tar if info.name not in (".", "./"))


def _zip_member(opened: zipfile.ZipFile, info: zipfile.ZipInfo) -> _Member:
    kind: Any = "folder" if info.is_dir() else "file"
    if stat.S_IFMT(info.external_attr >> 16) not in (0, stat.S_IFREG, stat.S_IFDIR):
        kind = "link or device"
    elif info.flag_bits & 0x1:
        kind = "encrypted file"
    elif info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise ValueError(f"{info.filename!r} is compressed in an unusual way")
    return _Member(_plain(info.orig_filename), info.file_size, kind, lambda: opened.open(info))


def _tar_member(tar: tarfile.TarFile, info: tarfile.TarInfo) -> _Member:
    kind: Any = "link or device"
    if info.isdir():
        kind = "folder"
    elif info.isreg() and not info.issparse():
        kind = "file"
    return _Member(_plain(info.name), info.size, kind, lambda: cast(Any, tar.extractfile(info)))


def _plain(name: str) -> str:
    """Return a name without the ``./`` and ``/`` that archivers put around it."""
    return name.removeprefix("./").removesuffix("/")


class _Bounded:
    """A stream that gives no more than a block at once: a header may claim gigabytes."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream
        self.seek = stream.seek
        self.tell = stream.tell

    def read(self, size: int = -1) -> bytes:
        if not 0 <= size <= _BLOCK:
            raise ValueError("a header in it is too large")
        data: bytes = self._stream.read(size)
        return data


@contextmanager
def _explained(archive: Path) -> Iterator[None]:
    damaged = (
        zipfile.BadZipFile,
        tarfile.TarError,
        gzip.BadGzipFile,
        zlib.error,
        EOFError,
        NotImplementedError,
        RuntimeError,
        ValueError,
    )
    try:
        yield
    except UnreadableInput:
        raise
    except damaged as error:
        raise UnreadableInput(
            f"{archive} cannot be unpacked ({error}): copy or make it again, as zip or tar.gz"
        ) from error


def _too_much(archive: Path) -> UnreadableInput:
    return _refused(
        archive,
        f"it holds more than {in_words(MAX_BYTES)}, or {MAX_RATIO} times its own size",
    )


def _refused(archive: Path, why: str) -> UnreadableInput:
    return UnreadableInput(
        f"{archive} is not unpacked, since {why}: unpack it yourself if you trust it, and give "
        "the folder"
    )
