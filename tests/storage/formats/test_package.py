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


@pytest.mark.parametrize("name", ["../a.txt", "/etc/a.txt", "a/../../b", "a\\b", "", MANIFEST])
def test_no_file_leaves_the_package(tmp_path: Path, name: str) -> None:
    folder = tmp_path / "out" / "desk"
    with pytest.raises(PackageError, match="cannot be a file of the package"):
        write_package(folder, {"a.txt": b"a", name: b"x"}, "b3:1")
    assert not [p for p in tmp_path.rglob("*") if p.is_file()]
    write_package(folder, {"a.txt": b"a"}, "b3:1")
    with pytest.raises(PackageError, match="cannot be a file of the package"):
        update_package(folder, {name: b"x"})


def test_a_package_that_is_a_link_is_refused_and_what_it_leads_to_stays(tmp_path: Path) -> None:
    real = tmp_path / "real"
    write_package(real, {"a.txt": b"a", "report.json": b"{}"}, "b3:1")
    link = tmp_path / "desk"
    link.symlink_to(real)
    assert package_source(link) is None
    for change in (
        lambda: write_package(link, {"a.txt": b"new"}, "b3:2"),
        lambda: update_package(link, {"report.json": b"new"}),
    ):
        with pytest.raises(PackageError, match="is a link"):
            change()
    assert (real / "report.json").read_bytes() == b"{}"
    assert package_source(real) == "b3:1"


def test_links_inside_a_package_are_not_followed(tmp_path: Path) -> None:
    folder, outside = tmp_path / "desk", tmp_path / "outside"
    outside.mkdir()
    (outside / "report.json").write_bytes(b"mine")
    write_package(folder, {"report.json": b"{}", "assets/a.txt": b"a"}, "b3:1")
    (folder / "report.json").unlink()
    (folder / "report.json").symlink_to(outside / "report.json")
    (folder / ".report.json.partial").symlink_to(outside / "report.json")
    update_package(folder, {"report.json": b"new"})
    assert (outside / "report.json").read_bytes() == b"mine"
    assert (folder / "report.json").read_bytes() == b"new"
    (folder / "assets" / "a.txt").unlink()
    (folder / "assets").rmdir()
    (folder / "assets").symlink_to(outside)
    with pytest.raises(PackageError, match="assets is a link"):
        update_package(folder, {"assets/report.json": b"new"})
    write_package(folder, {"assets/report.json": b"whole"}, "b3:2")
    assert (outside / "report.json").read_bytes() == b"mine"
    assert (folder / "assets" / "report.json").read_bytes() == b"whole"


def test_a_manifest_that_names_files_outside_counts_as_none(tmp_path: Path) -> None:
    folder = tmp_path / "desk"
    write_package(folder, {"a.txt": b"a"}, "b3:1")
    (tmp_path / "b.txt").write_bytes(b"b")
    manifest = json.loads((folder / MANIFEST).read_text())
    manifest["files"]["../b.txt"] = manifest["files"]["a.txt"]
    (folder / MANIFEST).write_text(json.dumps(manifest))
    assert package_source(folder) is None
