"""Photo folders: upright, scaled, focal length from EXIF; bad files named with a remedy."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import ExifTags, Image

from storage.formats.errors import UnreadableInput
from storage.formats.photos import natural_key, photo_paths, photo_size, read_photo

LONG, SHORT = 64, 48


def gradient(width: int = LONG, height: int = SHORT) -> Image.Image:
    y, x = np.mgrid[0:height, 0:width]
    channels = [255 * x / width, 255 * y / height, np.full(x.shape, 60)]
    return Image.fromarray(np.stack(channels, -1).astype(np.uint8))


def exif(**tags: object) -> Image.Exif:
    data = Image.Exif()
    inner = data.get_ifd(ExifTags.IFD.Exif)
    for name, value in tags.items():
        tag = ExifTags.Base[name]
        (data if name == "Orientation" else inner)[tag] = value
    return data


def test_photos_come_in_natural_order_and_nothing_else_does(tmp_path: Path) -> None:
    for name in ("img10.jpg", "img2.JPG", "img1.png"):
        gradient().save(tmp_path / name)
    (tmp_path / "notes.txt").write_text("no photo")
    (tmp_path / "movie.mp4").write_bytes(b"no photo either")
    assert [p.name for p in photo_paths(tmp_path)] == ["img1.png", "img2.JPG", "img10.jpg"]
    assert natural_key("a2b10") < natural_key("a10b2")


def test_photos_in_images_are_found(tmp_path: Path) -> None:
    (tmp_path / "images").mkdir()
    gradient().save(tmp_path / "images" / "a.jpg")
    assert [p.name for p in photo_paths(tmp_path)] == ["a.jpg"]


@pytest.mark.parametrize("orientation", range(1, 9))
def test_every_exif_orientation_is_made_upright(tmp_path: Path, orientation: int) -> None:
    """A viewer's picture is the same however the sensor was held."""
    undo = {
        2: Image.Transpose.FLIP_LEFT_RIGHT,
        3: Image.Transpose.ROTATE_180,
        4: Image.Transpose.FLIP_TOP_BOTTOM,
        5: Image.Transpose.TRANSPOSE,
        6: Image.Transpose.ROTATE_90,
        7: Image.Transpose.TRANSVERSE,
        8: Image.Transpose.ROTATE_270,
    }
    stored = gradient()
    if orientation in undo:
        stored = stored.transpose(undo[orientation])
    path = tmp_path / "a.png"
    stored.save(path, exif=exif(Orientation=orientation))
    photo = read_photo(path, 1600)
    assert np.array_equal(photo.rgb, np.asarray(gradient()))
    assert photo.original_size == photo_size(path) == (LONG, SHORT)


def test_large_photos_are_averaged_down_and_remember_their_size(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    gradient(640, 480).save(path)
    photo = read_photo(path, 64)
    assert photo.rgb.shape == (48, 64, 3) and photo.original_size == (640, 480)
    blocks = np.asarray(gradient(640, 480)).reshape(48, 10, 64, 10, 3).mean((1, 3))
    assert np.abs(photo.rgb - blocks).max() <= 1


def test_large_jpegs_keep_their_average(tmp_path: Path) -> None:
    path = tmp_path / "a.jpg"
    gradient(1280, 960).save(path, quality=95)
    photo = read_photo(path, 128)
    blocks = np.asarray(gradient(1280, 960)).reshape(96, 10, 128, 10, 3).mean((1, 3))
    assert np.abs(photo.rgb - blocks).max() < 4


def test_focal_length_from_the_35_mm_equivalent(tmp_path: Path) -> None:
    """The equivalent is of the diagonal: 43.27 mm see as much as the diagonal is long."""
    path = tmp_path / "a.jpg"
    gradient(640, 480).save(path, exif=exif(FocalLengthIn35mmFilm=50))
    expected = 50 / np.hypot(36, 24) * np.hypot(640, 480)
    assert read_photo(path, 1600).focal_px == pytest.approx(expected)
    assert read_photo(path, 320).focal_px == pytest.approx(expected / 2)


def test_focal_length_from_the_sensor(tmp_path: Path) -> None:
    path = tmp_path / "a.jpg"
    tags = exif(
        FocalLength=5.4,
        FocalPlaneXResolution=2540.0,
        FocalPlaneResolutionUnit=2,
        ExifImageWidth=640,
    )
    gradient(640, 480).save(path, exif=tags)
    # 2540 pixels an inch are 100 a millimetre.
    assert read_photo(path, 1600).focal_px == pytest.approx(540.0)


@pytest.mark.parametrize("tags", [{}, {"FocalLengthIn35mmFilm": 0}, {"FocalLength": 5.4}])
def test_no_focal_length_without_evidence(tmp_path: Path, tags: dict[str, float]) -> None:
    path = tmp_path / "a.jpg"
    gradient().save(path, exif=exif(**tags))
    assert read_photo(path, 1600).focal_px is None


@pytest.mark.parametrize("mode", ["L", "RGBA", "P", "CMYK"])
def test_other_colour_modes_become_rgb(tmp_path: Path, mode: str) -> None:
    path = tmp_path / ("a.jpg" if mode == "CMYK" else "a.png")
    gradient().convert(mode).save(path)
    assert read_photo(path, 1600).rgb.shape == (SHORT, LONG, 3)


def test_sixteen_bit_photos_keep_their_brightness(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    Image.fromarray(np.full((SHORT, LONG), 128 * 257, np.uint16)).save(path)
    assert np.abs(read_photo(path, 1600).rgb.astype(int) - 128).max() <= 1


def test_heic_is_read_where_the_library_is(tmp_path: Path) -> None:
    heif = pytest.importorskip("pillow_heif")
    heif.register_heif_opener()
    path = tmp_path / "a.HEIC"
    gradient().save(path, format="HEIF", quality=95)
    photo = read_photo(path, 1600)
    assert np.abs(photo.rgb.astype(int) - np.asarray(gradient()).astype(int)).mean() < 5


def test_missing_folder_and_empty_folder_are_named(tmp_path: Path) -> None:
    with pytest.raises(UnreadableInput, match=r"no such folder: .*absent"):
        photo_paths(tmp_path / "absent")
    with pytest.raises(UnreadableInput, match="no photos in"):
        photo_paths(tmp_path)


@pytest.mark.parametrize("suffix", [".jpg", ".png"])
def test_a_truncated_photo_is_named(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"cut{suffix}"
    gradient(400, 300).save(path)
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(UnreadableInput, match=f"cut{suffix}.*copy the photo again or remove it"):
        read_photo(path, 1600)


def test_a_file_that_is_no_photo_is_named(tmp_path: Path) -> None:
    path = tmp_path / "page.jpg"
    path.write_text("<html>not found</html>")
    with pytest.raises(UnreadableInput, match=r"page\.jpg"):
        read_photo(path, 1600)


def test_a_gigapixel_is_refused_from_its_header(tmp_path: Path) -> None:
    """A few bytes that claim 40000 x 40000 pixels; decoding them would take gigabytes."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return (
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        )

    path = tmp_path / "bomb.png"
    header = struct.pack(">IIBBBBB", 40000, 40000, 8, 2, 0, 0, 0)
    path.write_bytes(
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(b"\0" * 99))
    )
    for read in (photo_size, lambda p: read_photo(p, 1600)):
        with pytest.raises(UnreadableInput, match=r"bomb\.png is too large"):
            read(path)
