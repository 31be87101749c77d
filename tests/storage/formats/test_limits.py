"""Files are refused by their size or header, by a sentence with name, size and limit."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from storage.formats import photos, video
from storage.formats.errors import UnreadableInput
from storage.formats.limits import check_file_size, in_words, read_json
from storage.formats.nerfstudio import read_transforms, read_transforms_cameras
from storage.formats.photos import photo_paths, photo_size, read_photo
from storage.formats.video import read_frames


def picture(path: Path, size: tuple[int, int] = (30, 20), form: str | None = None) -> Path:
    Image.fromarray(np.zeros((size[1], size[0], 3), np.uint8)).save(path, format=form)
    return path


def sparse(path: Path, size: int) -> Path:
    with path.open("wb") as file:
        file.truncate(size)
    return path


@pytest.mark.parametrize("read", [photo_size, lambda path: read_photo(path, 64)])
def test_a_photo_of_too_many_bytes(tmp_path: Path, read: object) -> None:
    path = sparse(tmp_path / "a.jpg", photos.MAX_BYTES + 1)
    with pytest.raises(UnreadableInput, match=r"a\.jpg is too large for a photo \(1 GB; at most 1"):
        read(path)  # type: ignore[operator]


def test_photos_of_todays_telephones_are_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Pillow by itself refuses what is larger than twice 89 megapixels."""
    assert Image.MAX_IMAGE_PIXELS == photos.MAX_PIXELS == 200_000_000
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 500)
    monkeypatch.setattr(photos, "MAX_PIXELS", 500)
    with pytest.raises(UnreadableInput, match="30 x 20 pixels"):
        photo_size(picture(tmp_path / "a.png"))


def test_what_is_called_a_photo_runs_no_program(tmp_path: Path) -> None:
    """Pillow opens files by content; for EPS it starts Ghostscript."""
    for form in ("EPS", "TIFF", "GIF", "BMP"):
        path = picture(tmp_path / f"{form}.jpg", form=form)
        with pytest.raises(UnreadableInput, match="cannot be decoded"):
            read_photo(path, 64)
    assert read_photo(picture(tmp_path / "w.jpg", form="WEBP"), 64).rgb.shape == (20, 30, 3)


def test_hidden_files_are_no_photos(tmp_path: Path) -> None:
    picture(tmp_path / "a.jpg")
    (tmp_path / "._a.jpg").write_bytes(b"what macOS puts beside a file")
    assert [path.name for path in photo_paths(tmp_path)] == ["a.jpg"]


def make_video(path: Path, size: tuple[int, int]) -> Path:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 30, size)
    for shade in range(3):
        writer.write(np.full((size[1], size[0], 3), 40 * shade, np.uint8))
    writer.release()
    return path


@pytest.mark.parametrize(
    ("limit", "value", "says"),
    [
        ("MAX_BYTES", 10, r"a\.avi is too large for a video"),
        ("MAX_PIXELS", 320 * 240 - 1, r"a\.avi has frames of 320 x 240 pixels"),
        ("MAX_FRAMES", 2, r"a\.avi has 3 frames \(at most 2\)"),
    ],
)
def test_a_video_beyond_a_limit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, limit: str, value: int, says: str
) -> None:
    path = make_video(tmp_path / "a.avi", (320, 240))
    monkeypatch.setattr(video, limit, value)
    with pytest.raises(UnreadableInput, match=says):
        read_frames(path, 3, 320)


def test_json_beyond_its_limits(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text(json.dumps(list(range(100))))
    assert len(read_json(path)) == 100
    with pytest.raises(UnreadableInput, match=r"a\.json is too large for a JSON file \(390 bytes"):
        read_json(path, 100)
    path.write_text("[" * 100_000)
    with pytest.raises(ValueError, match="nested too deeply"):
        read_json(path)
    with pytest.raises(UnreadableInput, match=r"b\.json cannot be read"):
        check_file_size(tmp_path / "b.json", 1, "x")
    assert [in_words(n) for n in (12, 1_500_000, 2_000_000_000)] == ["12 bytes", "1.5 MB", "2 GB"]


def transforms(path: Path, *photos: str, **values: object) -> Path:
    frame = {"transform_matrix": np.eye(4).tolist(), "w": 30, "h": 20, "fl_x": 9, "cx": 1, "cy": 1}
    frames = [{"file_path": photo, **frame, **values} for photo in photos]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({"frames": frames}))
    return path


@pytest.mark.parametrize("photo", ["../a.jpg", "/etc/a.jpg", "images/../../a.jpg", "a\0b.jpg"])
def test_a_transforms_json_names_no_photo_outside_its_folder(tmp_path: Path, photo: str) -> None:
    path = transforms(tmp_path / "room" / "transforms.json", photo)
    with pytest.raises(UnreadableInput, match=r"outside its folder.*--cameras"):
        read_transforms(path)
    assert len(read_transforms_cameras(path)) == 1  # opens no photo: names only match


def test_photos_inside_are_named_as_anybody_writes_them(tmp_path: Path) -> None:
    room = tmp_path / "room"
    names = ["a.jpg", "./images/b.jpg", "x/../c.jpg", str(room / "d.jpg")]
    _cameras, found = read_transforms(transforms(room / "transforms.json", *names))
    assert found == tuple(room / n for n in ("a.jpg", "images/b.jpg", "c.jpg", "d.jpg"))


def test_a_link_of_the_users_own_may_lead_anywhere(tmp_path: Path) -> None:
    (tmp_path / "photos").mkdir()
    picture(tmp_path / "photos" / "a.jpg")
    path = transforms(tmp_path / "room" / "transforms.json", "images/a.jpg")
    (tmp_path / "room" / "images").symlink_to("../photos")
    (photo,) = read_transforms(path)[1]
    assert photo_size(photo) == (30, 20)


@pytest.mark.parametrize("broken", [{"cx": float("nan")}, {"fl_x": "x"}, {"w": None}])
def test_numbers_that_are_none_name_the_frame(tmp_path: Path, broken: dict[str, object]) -> None:
    path = transforms(tmp_path / "transforms.json", "a.jpg", **broken)
    with pytest.raises(UnreadableInput, match="frame 0 of"):
        read_transforms(path)
