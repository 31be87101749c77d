"""A package is the old one or the whole new one, and never somebody else's folder."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from storage.formats.package import (
    MANIFEST,
    PackageError,
    package_source,
    update_package,
    write_package,
)


def test_files_and_manifest_are_written(tmp_path: Path) -> None:
    write_package(tmp_path / "out" / "desk", {"a.txt": b"a", "assets/b.obj": b"bb"}, "b3:1")
    assert (tmp_path / "out/desk/assets/b.obj").read_bytes() == b"bb"
    manifest = json.loads((tmp_path / "out/desk" / MANIFEST).read_text())
    assert manifest["files"]["assets/b.obj"]["bytes"] == 2
    assert package_source(tmp_path / "out/desk") == "b3:1"


def test_a_new_package_replaces_the_old_one_whole(tmp_path: Path) -> None:
    folder = tmp_path / "desk"
    write_package(folder, {"old.txt": b"old"}, "b3:1")
    write_package(folder, {"new.txt": b"new"}, "b3:2")
    assert sorted(p.name for p in folder.iterdir()) == [MANIFEST, "new.txt"]
    assert [p.name for p in tmp_path.iterdir()] == ["desk"]


def test_a_foreign_folder_is_never_touched(tmp_path: Path) -> None:
    (tmp_path / "desk").mkdir()
    (tmp_path / "desk" / "thesis.doc").write_bytes(b"years of work")
    with pytest.raises(PackageError, match="not a GARDEN package"):
        write_package(tmp_path / "desk", {"a.txt": b"a"}, "b3:1")
    assert (tmp_path / "desk" / "thesis.doc").read_bytes() == b"years of work"


def test_a_place_that_cannot_be_written_is_named_with_the_remedy(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_bytes(b"")
    with pytest.raises(PackageError, match=r"file cannot be written to.*--out"):
        write_package(blocked / "desk", {"a.txt": b"a"}, "b3:1")


def test_a_full_disk_leaves_the_old_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "desk"
    write_package(folder, {"a.txt": b"old"}, "b3:1")
    written = Path.write_bytes

    def full(path: Path, data: bytes) -> int:
        if path.name == "b.txt":
            raise OSError(28, "No space left on device")
        return written(path, data)

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(PackageError, match=r"no space left.*free some space"):
        write_package(folder, {"a.txt": b"new", "b.txt": b"b"}, "b3:2")
    assert (folder / "a.txt").read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["desk"]


def test_a_package_that_lost_a_file_counts_as_none(tmp_path: Path) -> None:
    folder = tmp_path / "desk"
    write_package(folder, {"a.txt": b"a"}, "b3:1")
    (folder / "a.txt").unlink()
    assert package_source(folder) is None


def test_an_update_keeps_the_rest_and_the_source(tmp_path: Path) -> None:
    folder = tmp_path / "desk"
    write_package(folder, {"a.txt": b"a", "report.json": b"{}"}, "b3:1")
    update_package(folder, {"report.json": b'{"executed": 0}'})
    assert package_source(folder) == "b3:1"
    assert (folder / "a.txt").read_bytes() == b"a"
