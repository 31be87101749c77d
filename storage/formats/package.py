"""Write a folder of files so that it is either the old one or the whole new one."""

from __future__ import annotations

import errno
import json
import os
import shutil
import tempfile
from pathlib import Path

from blake3 import blake3

from storage.formats.member_name import is_inside

MANIFEST = "manifest.json"


class PackageError(OSError):
    """The package could not be written; the message names the folder and the remedy."""


def check_writable(folder: Path) -> None:
    """Raise PackageError if a package cannot be written to ``folder`` (tried, not guessed).

    A link is refused: what it leads to is not ours to replace.
    """
    if folder.is_symlink():
        raise PackageError(_link(folder))
    if folder.exists() and (not folder.is_dir() or _is_foreign(folder)):
        raise PackageError(
            f"{folder} exists and is not a GARDEN package: choose another --out or --name"
        )
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=f".{folder.name}-", dir=folder.parent) as probe:
            (Path(probe) / "probe").write_bytes(b"\0")
    except OSError as error:
        raise _explained(error, folder) from error


def write_package(folder: Path, files: dict[str, bytes], source: str) -> None:
    """Write ``files`` (relative name to content) and a manifest into ``folder``.

    ``source`` identifies what the files were made from. The files are staged beside
    ``folder`` and moved into place at the end, so that a crash leaves the old package;
    a folder that exists and is no package is never touched. Raises PackageError.
    """
    for name in files:
        _check_member(name, folder)
    check_writable(folder)
    try:
        staged = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
    except OSError as error:
        raise _explained(error, folder) from error
    try:
        for name, content in files.items():
            path = staged / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        (staged / MANIFEST).write_bytes(_manifest(files, source))
        staged.chmod(0o755)
        _replace(staged, folder)
    except OSError as error:
        raise _explained(error, folder) from error
    finally:
        shutil.rmtree(staged, ignore_errors=True)


def update_package(folder: Path, files: dict[str, bytes]) -> None:
    """Replace some files of a package, each atomically, and its manifest last.

    No link is followed: neither the package's folder nor one inside it may be one.
    """
    for name in files:
        _check_member(name, folder)
        for place in (folder, *(folder / name).parents[: name.count("/")]):
            if place.is_symlink():
                raise PackageError(_link(place))
    manifest = json.loads((folder / MANIFEST).read_bytes())
    try:
        for name, content in files.items():
            _write_atomically(folder / name, content)
            manifest["files"][name] = _entry(content)
        _write_atomically(folder / MANIFEST, _dump(manifest))
    except OSError as error:
        raise _explained(error, folder) from error


def package_source(folder: Path) -> str | None:
    """Return what the package in ``folder`` was made from, or None if it is incomplete."""
    if folder.is_symlink():
        return None
    try:
        manifest = json.loads((folder / MANIFEST).read_bytes())
        complete = all(
            is_inside(name) and (folder / name).lstat().st_size == entry["bytes"]
            for name, entry in manifest["files"].items()
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None
    return str(manifest["source"]) if complete else None


def _check_member(name: str, folder: Path) -> None:
    if not is_inside(name) or name == MANIFEST:
        raise PackageError(f"{name!r} cannot be a file of the package {folder}: it would leave it")


def _link(place: Path) -> str:
    return f"{place} is a link: remove it, or choose another --out or --name"


def _is_foreign(folder: Path) -> bool:
    return any(folder.iterdir()) and not (folder / MANIFEST).is_file()


def _replace(staged: Path, folder: Path) -> None:
    old = None
    if folder.exists():
        old = Path(tempfile.mkdtemp(prefix=f".{folder.name}-old-", dir=folder.parent))
        folder.rename(old / folder.name)
    staged.rename(folder)
    if old is not None:
        shutil.rmtree(old, ignore_errors=True)


def _write_atomically(path: Path, content: bytes) -> None:
    descriptor, name = tempfile.mkstemp(prefix=f".{path.name}-", dir=path.parent)
    partial = Path(name)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(content)
        partial.chmod(0o644)
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def _manifest(files: dict[str, bytes], source: str) -> bytes:
    entries = {name: _entry(content) for name, content in sorted(files.items())}
    return _dump({"schema": "garden.package/1", "source": source, "files": entries})


def _entry(content: bytes) -> dict[str, int | str]:
    return {"bytes": len(content), "b3": f"b3:{blake3(content).hexdigest()}"}


def _dump(value: object) -> bytes:
    return (json.dumps(value, indent=1, sort_keys=True) + "\n").encode()


def _explained(error: OSError, folder: Path) -> PackageError:
    if isinstance(error, PackageError):
        return error
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return PackageError(
            f"no space left for the package {folder}: free some space and run the same command "
            "again; what was computed is in the store"
        )
    if error.errno in (errno.EROFS, errno.EACCES, errno.EPERM, errno.EEXIST, errno.ENOTDIR):
        return PackageError(f"{folder.parent} cannot be written to: give another folder with --out")
    return PackageError(f"the package {folder} could not be written: {error}")
