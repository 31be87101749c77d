"""Unpack the archive of a capture once, into the user's cache, by its content.

The same archive leads to the same files however often it is given and wherever it lies;
what was not used for two weeks is removed when another archive is unpacked.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import time
import uuid
from pathlib import Path

from storage.digest import digest_file, hexadecimal
from storage.formats.archive_name import MAX_BYTES, archive_stem
from storage.formats.errors import UnreadableInput
from storage.formats.limits import check_file_size
from storage.user_folders import cache_folder

KEPT_S = 14 * 86400.0


def unpacked(archive: Path) -> Path:
    """Return the folder (or the one video) that was in ``archive``.

    Raises UnreadableInput for an archive that is damaged, unsafe, or has no room.
    """
    check_file_size(archive, MAX_BYTES, "an archive")
    place = cache_folder() / "captures"
    digest = hexadecimal(digest_file(archive))
    folder = place / f"{archive_stem(archive)[:60]}-{digest[:24]}"
    if not folder.is_dir():
        _unpack(archive, folder)
        _forget_unused(place)
    os.utime(folder)
    return _capture_in(folder)


def _unpack(archive: Path, folder: Path) -> None:
    from storage.formats.archive import unpack

    staged = folder.parent / f".{uuid.uuid4().hex}"
    try:
        unpack(archive, staged)
        with contextlib.suppress(FileExistsError):  # somebody was faster, with the same files
            _move(staged, folder)
    except OSError as error:
        raise UnreadableInput(
            f"{archive} cannot be unpacked in {folder.parent} ({error.strerror}): make room "
            "there, set XDG_CACHE_HOME to another folder, or unpack it yourself"
        ) from error
    finally:
        shutil.rmtree(staged, ignore_errors=True)


def _move(staged: Path, folder: Path) -> None:
    try:
        staged.rename(folder)
    except OSError:
        if not folder.is_dir():
            raise


def _forget_unused(place: Path) -> None:
    """Remove what no run has asked for lately; a run touches its folder when it starts."""
    oldest = time.time() - KEPT_S
    for folder in place.iterdir():
        with contextlib.suppress(OSError):
            if folder.stat().st_mtime < oldest:
                shutil.rmtree(folder, ignore_errors=True)


def _capture_in(folder: Path) -> Path:
    """Go into folders that hold nothing but one folder; take a video that is alone."""
    while True:
        inside = list(folder.iterdir())
        if len(inside) != 1:
            return folder
        only = inside[0]
        if only.is_file():
            return only
        if only.name == "images":
            return folder
        folder = only
