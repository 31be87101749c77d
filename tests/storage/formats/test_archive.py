"""An archive is unpacked inside its folder or refused as a whole, within limits."""

from __future__ import annotations

import gzip
import io
import stat
import tarfile
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from storage.formats import archive
from storage.formats.archive import unpack
from storage.formats.archive_name import archive_stem, is_archive
from storage.formats.errors import UnreadableInput
from storage.formats.member_name import is_inside

FILES = {"room/a.jpg": b"a" * 3000, "room/images/b.jpg": b"b", "room/targets.json": b"{}"}
Make = Callable[[Path, dict[str, bytes]], Path]


def make_zip(path: Path, files: dict[str, bytes]) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as out:
        for name, data in files.items():
            out.writestr(name, data)
    return path


def make_tar(path: Path, files: dict[str, bytes]) -> Path:
    with tarfile.open(path, "w:gz" if path.name.endswith("gz") else "w") as out:
        for name, data in files.items():
            info = tarfile.TarInfo(name)
            info.size = len(data)
            out.addfile(info, io.BytesIO(data))
    return path


MAKERS = pytest.mark.parametrize(
    ("make", "name"), [(make_zip, "x.zip"), (make_tar, "x.tar"), (make_tar, "x.tar.gz")]
)


def contents(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


@MAKERS
def test_files_come_out_as_they_went_in(tmp_path: Path, make: Make, name: str) -> None:
    unpack(make(tmp_path / name, FILES), tmp_path / "out")
    assert contents(tmp_path / "out") == FILES


@MAKERS
def test_only_files_of_a_capture_are_taken(tmp_path: Path, make: Make, name: str) -> None:
    extra = {"room/run.sh": b"#!", "__MACOSX/room/._a.jpg": b"x", "room/.hidden.jpg": b"x"}
    unpack(make(tmp_path / name, FILES | extra), tmp_path / "out")
    assert contents(tmp_path / "out") == FILES


UNSAFE = [
    "../a.jpg",
    "/etc/a.jpg",
    "room/../../a.jpg",
    "room\\..\\..\\a.jpg",
    "C:/a.jpg",
    "a/./b.jpg",
]


@MAKERS
@pytest.mark.parametrize("unsafe", UNSAFE)
def test_a_name_that_leads_out_is_refused(
    tmp_path: Path, make: Make, name: str, unsafe: str
) -> None:
    made = make(tmp_path / name, FILES | {unsafe: b"x"})
    with pytest.raises(UnreadableInput, match="outside the folder"):
        unpack(made, tmp_path / "in" / "out")
    assert not [p for p in tmp_path.rglob("*") if p.is_file() and p != made and
                not p.is_relative_to(tmp_path / "in" / "out")]  # fmt: skip


NAMES = st.lists(
    st.sampled_from(["..", ".", "", "a", "b.jpg", "\\", "C:", "~", "\0", "é", "a" * 300, "x\ny"]),
    min_size=1,
    max_size=5,
).map("/".join)


@given(name=NAMES | st.text(max_size=40))
def test_a_name_that_counts_as_inside_stays_inside(name: str) -> None:
    if is_inside(name):
        base = Path("/base/folder")
        place = base / name
        assert ".." not in place.parts
        assert place.is_relative_to(base) and place != base
        assert "\0" not in name and "\\" not in name


def test_plain_names_count_as_inside() -> None:
    assert all(map(is_inside, ["a", "room/IMG 1 (2).jpg", "..a/b..", "é/ü.png", "ab:c/d"]))


@pytest.mark.parametrize(
    "kind", [tarfile.SYMTYPE, tarfile.LNKTYPE, tarfile.CHRTYPE, tarfile.FIFOTYPE]
)
def test_links_and_devices_in_a_tar_are_refused(tmp_path: Path, kind: bytes) -> None:
    path = tmp_path / "x.tar"
    with tarfile.open(path, "w") as out:
        info = tarfile.TarInfo("room/a.jpg")
        info.type, info.linkname = kind, "/etc/passwd"
        out.addfile(info)
    with pytest.raises(UnreadableInput, match="link or device"):
        unpack(path, tmp_path / "out")


def test_a_link_in_a_zip_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.zip"
    with zipfile.ZipFile(path, "w") as out:
        info = zipfile.ZipInfo("room/a.jpg")
        info.external_attr = (stat.S_IFLNK | 0o777) << 16
        out.writestr(info, "/etc/passwd")
    with pytest.raises(UnreadableInput, match="link or device"):
        unpack(path, tmp_path / "out")


def test_a_second_file_of_one_name_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.tar"
    with tarfile.open(path, "w") as out:
        for data in (b"1", b"22"):
            info = tarfile.TarInfo("a.jpg")
            info.size = len(data)
            out.addfile(info, io.BytesIO(data))
    with pytest.raises(UnreadableInput, match="twice"):
        unpack(path, tmp_path / "out")


@MAKERS
def test_a_bomb_is_stopped(
    tmp_path: Path, make: Make, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(archive, "RATIO_FROM", 1_000_000)
    monkeypatch.setattr(archive, "MAX_BYTES", 5_000_000)
    made = make(tmp_path / name, {f"{i}.jpg": b"\0" * 900_000 for i in range(6)})
    with pytest.raises(UnreadableInput, match=r"holds more than|too large"):
        unpack(made, tmp_path / "out")
    assert sum(map(len, contents(tmp_path / "out").values())) <= 5_000_000


def test_a_header_that_says_less_than_there_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The size in a zip's directory is the sender's word; the bytes are what counts."""
    path = make_zip(tmp_path / "x.zip", {"a.jpg": b"\0" * 200_000})
    data = path.read_bytes().replace((200_000).to_bytes(4, "little"), (10).to_bytes(4, "little"))
    path.write_bytes(data)
    monkeypatch.setattr(archive, "RATIO_FROM", 1_000)
    with pytest.raises(UnreadableInput, match=r"cannot be unpacked|holds more"):
        unpack(path, tmp_path / "out")
    assert sum(map(len, contents(tmp_path / "out").values())) <= 100 * path.stat().st_size


def test_a_header_of_gigabytes_is_not_read(tmp_path: Path) -> None:
    """A tar's long name may claim any size, and is read into memory whole."""
    info = tarfile.TarInfo("././@LongLink")
    info.type, info.size = tarfile.GNUTYPE_LONGNAME, 40_000_000_000
    path = tmp_path / "x.tar.gz"
    path.write_bytes(gzip.compress(info.tobuf(tarfile.GNU_FORMAT) + b"\0" * 100_000))
    with pytest.raises(UnreadableInput, match="too large"):
        unpack(path, tmp_path / "out")


@MAKERS
def test_too_many_files_are_refused(
    tmp_path: Path, make: Make, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(archive, "MAX_MEMBERS", 2)
    with pytest.raises(UnreadableInput, match="more than 2 files"):
        unpack(make(tmp_path / name, FILES), tmp_path / "out")


@MAKERS
@given(cut=st.floats(0.0, 0.95))
def test_a_truncated_archive_is_named(
    tmp_path_factory: pytest.TempPathFactory, make: Make, name: str, cut: float
) -> None:
    folder = tmp_path_factory.mktemp("cut")
    made = make(folder / name, {"a.jpg": bytes(range(256)) * 40, "b.jpg": b"b" * 3000})
    whole = made.read_bytes()
    made.write_bytes(whole[: int(cut * min(len(whole), 10_000))])
    try:
        unpack(made, folder / "out")
    except UnreadableInput as error:
        assert name in str(error)
    else:  # a tar that ends between two files looks like a shorter one
        assert name == "x.tar"


def test_an_encrypted_zip_says_so(tmp_path: Path) -> None:
    path = make_zip(tmp_path / "x.zip", {"a.jpg": b"a"})
    data = bytearray(path.read_bytes())
    data[data.index(b"PK\x01\x02") + 8] |= 1
    path.write_bytes(bytes(data))
    with pytest.raises(UnreadableInput, match="encrypted"):
        unpack(path, tmp_path / "out")


def test_names_of_archives() -> None:
    assert is_archive(Path("a/Room.ZIP")) and not is_archive(Path("a.json"))
    assert [archive_stem(Path(n)) for n in ("r.zip", "r.tar.gz", "r.v2.TGZ")] == ["r", "r", "r.v2"]
