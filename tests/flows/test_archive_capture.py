"""A capture may come as an archive: same scene, same keys, nothing outside the cache."""

from __future__ import annotations

import os
import shutil
import zipfile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from flows import unpacked as unpacking
from flows.capture import find_capture
from flows.command import main
from flows.unpacked import unpacked
from storage.formats.errors import UnreadableInput


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "garden" / "captures"


@pytest.fixture
def room(tmp_path: Path) -> Path:
    folder = tmp_path / "room"
    (folder / "images").mkdir(parents=True)
    for i in range(3):
        grey = np.full((60, 80, 3), 40 * i, np.uint8)
        Image.fromarray(grey).save(folder / "images" / f"IMG_{i}.jpg")
    (folder / "targets.json").write_text('{"targets": []}')
    return folder


@pytest.fixture
def archive(room: Path, tmp_path: Path) -> Path:
    return Path(shutil.make_archive(str(tmp_path / "kitchen"), "zip", tmp_path, "room"))


def test_it_is_the_capture_that_was_packed(archive: Path, room: Path) -> None:
    packed, plain = find_capture(archive, None), find_capture(room, None)
    assert packed.source == plain.source  # by name, size and content, not by place
    assert packed.name == "kitchen"
    assert packed.targets_file is not None and packed.targets_file.name == "targets.json"
    assert packed.sizes == plain.sizes


def test_it_is_unpacked_once_wherever_it_lies(archive: Path, cache: Path, tmp_path: Path) -> None:
    first = unpacked(archive)
    (tmp_path / "elsewhere").mkdir()
    moved = Path(shutil.copy(archive, tmp_path / "elsewhere" / archive.name))
    stamp = (first / "images" / "IMG_0.jpg").stat().st_mtime_ns
    assert unpacked(moved) == first
    assert (first / "images" / "IMG_0.jpg").stat().st_mtime_ns == stamp
    assert [p.name[:8] for p in cache.iterdir()] == ["kitchen-"]


def test_an_archive_that_is_refused_leaves_nothing(cache: Path, tmp_path: Path) -> None:
    bad = tmp_path / "bad.zip"
    with zipfile.ZipFile(bad, "w") as out:
        out.writestr("a.jpg", b"x")
        out.writestr("../../escaped.jpg", b"x")
    with pytest.raises(UnreadableInput, match="outside the folder"):
        unpacked(bad)
    assert list(cache.iterdir()) == []
    assert not list(tmp_path.rglob("escaped.jpg"))


def test_unused_ones_are_removed_when_another_comes(
    archive: Path, cache: Path, room: Path, tmp_path: Path
) -> None:
    old = unpacked(archive).relative_to(cache).parts[0]
    os.utime(cache / old, (1.0, 1.0))
    second = Path(shutil.make_archive(str(tmp_path / "desk"), "gztar", room.parent, "room"))
    unpacked(second)
    assert [p.name[:5] for p in cache.iterdir()] == ["desk-"]
    assert unpacking.KEPT_S > 7 * 86400


def test_the_command_takes_it(
    archive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["plan", str(archive), "--store", str(tmp_path / "store")]) == 0
    assert "ingest" in capsys.readouterr().out
