"""Read a folder of photos: JPEG, PNG and HEIC, upright, with the focal length EXIF gives."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import UInt8
from PIL import ExifTags, Image, ImageOps, JpegImagePlugin, PngImagePlugin, WebPImagePlugin

from storage.formats.errors import UnreadableInput
from storage.formats.limits import check_file_size

SUFFIXES = (".jpg", ".jpeg", ".png", ".heic", ".heif")
MAX_PIXELS = 200_000_000
"""Photos larger than this are refused from their header, before they are decoded."""

MAX_BYTES = 1_000_000_000
"""Files larger than this are refused unopened; 200 megapixels of 16 bits have 1.2 GB raw."""

CODECS: tuple[str, ...] = (
    JpegImagePlugin.JpegImageFile.format,
    PngImagePlugin.PngImageFile.format,
    WebPImagePlugin.WebPImageFile.format,
)
"""What a photo may be, whatever its name says; other formats of Pillow run programs."""

Image.MAX_IMAGE_PIXELS = MAX_PIXELS  # Pillow's own is below what telephones take today

FULL_FRAME_MM = (36.0, 24.0)


@dataclass(frozen=True)
class PhotoFile:
    """A decoded photo. ``original_size`` is (width, height) of the upright file;
    ``focal_px`` is in pixels of ``rgb``.
    """

    name: str
    rgb: UInt8[np.ndarray, "h w 3"]
    original_size: tuple[int, int]
    focal_px: float | None


def photo_paths(folder: Path) -> list[Path]:
    """Return the photos in ``folder``, or in its ``images/``, in natural order.

    Hidden files are none. Raises UnreadableInput if there is no such folder or no photo in it.
    """
    if not folder.exists():
        raise UnreadableInput(f"no such folder: {folder}; check the path")
    inner = folder / "images"
    place = inner if inner.is_dir() else folder
    paths = [
        p
        for p in place.iterdir()
        if p.suffix.lower() in SUFFIXES and not p.name.startswith(".") and p.is_file()
    ]
    if not paths:
        raise UnreadableInput(
            f"no photos in {place}: put JPEG, PNG or HEIC files there (or name another folder)"
        )
    return sorted(paths, key=lambda p: natural_key(p.name))


def natural_key(name: str) -> list[tuple[int, int, str]]:
    """Return a sort key by which ``img2`` comes before ``img10``."""
    parts = re.split(r"(\d+)", name.lower())
    return [(0, int(p), "") if p.isdigit() else (1, 0, p) for p in parts]


def photo_size(path: Path) -> tuple[int, int]:
    """Return (width, height) of the upright photo from its header alone."""
    with _opened(path) as image:
        try:
            turned = image.getexif().get(ExifTags.Base.Orientation, 1) in (5, 6, 7, 8)
        except (OSError, SyntaxError, ValueError) as error:  # PNG may keep it at the end
            raise _damaged(path, error) from error
        return (image.height, image.width) if turned else (image.width, image.height)


def read_photo(path: Path, max_size: int) -> PhotoFile:
    """Decode a photo, turn it upright, and limit its long side to ``max_size`` pixels.

    Raises UnreadableInput for a file that is damaged, truncated or too large.
    """
    with _opened(path) as image:
        original = photo_size(path)
        try:
            focal_share = _focal_share(image)
            image.draft("RGB", (2 * max_size, 2 * max_size))
            upright = _eight_bit(ImageOps.exif_transpose(image)).convert("RGB")
        except (OSError, SyntaxError, ValueError) as error:
            raise _damaged(path, error) from error
    factor = min(1.0, max_size / max(original))
    size = (max(1, round(original[0] * factor)), max(1, round(original[1] * factor)))
    if upright.size != size:
        upright = upright.resize(size, Image.Resampling.BOX, reducing_gap=None)
    focal_px = None if focal_share is None else focal_share * max(size)
    return PhotoFile(path.name, np.asarray(upright), original, focal_px)


@contextmanager
def _opened(path: Path) -> Iterator[Image.Image]:
    check_file_size(path, MAX_BYTES, "a photo")
    codecs = CODECS
    if path.suffix.lower() in (".heic", ".heif"):
        from pillow_heif import register_heif_opener

        register_heif_opener()
        codecs = (*CODECS, "HEIF")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            image = Image.open(path, formats=codecs)
    except Image.DecompressionBombError as error:
        raise _too_large(path, f"more than {2 * MAX_PIXELS / 1e6:.0f} megapixels") from error
    except (OSError, SyntaxError, ValueError) as error:
        raise _damaged(path, error) from error
    with image:
        if image.width * image.height > MAX_PIXELS:
            raise _too_large(path, f"{image.width} x {image.height} pixels")
        yield image


def _eight_bit(image: Image.Image) -> Image.Image:
    """Return the high bytes of a 16-bit grey picture, which Pillow would clip at 255."""
    if not image.mode.startswith("I"):
        return image
    return Image.fromarray((np.asarray(image).astype(np.int64) >> 8).clip(0, 255).astype(np.uint8))


def _damaged(path: Path, error: Exception) -> UnreadableInput:
    return UnreadableInput(f"{path} cannot be decoded ({error}): copy the photo again or remove it")


def _too_large(path: Path, what: str) -> UnreadableInput:
    return UnreadableInput(
        f"{path} is too large ({what}; at most {MAX_PIXELS / 1e6:.0f} megapixels): scale it "
        "down or remove it"
    )


def _focal_share(image: Image.Image) -> float | None:
    """Return the focal length as a share of the picture's long side, if EXIF tells."""
    exif = image.getexif().get_ifd(ExifTags.IFD.Exif)
    long_side, short_side = max(image.size), min(image.size)
    equivalent = _positive(exif.get(ExifTags.Base.FocalLengthIn35mmFilm))
    if equivalent is not None:
        # The 35 mm equivalent is defined by the diagonal.
        diagonal = float(np.hypot(long_side, short_side))
        return equivalent / float(np.hypot(*FULL_FRAME_MM)) * diagonal / long_side
    focal_mm = _positive(exif.get(ExifTags.Base.FocalLength))
    density = _positive(exif.get(ExifTags.Base.FocalPlaneXResolution))
    unit_mm = {2: 25.4, 3: 10.0, 4: 1.0}.get(exif.get(ExifTags.Base.FocalPlaneResolutionUnit, 2))
    recorded = _positive(exif.get(ExifTags.Base.ExifImageWidth))
    if focal_mm is None or density is None or unit_mm is None or recorded is None:
        return None
    return focal_mm / unit_mm * density / max(recorded, long_side)


def _positive(value: object) -> float | None:
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, ZeroDivisionError):
        return None
    return number if np.isfinite(number) and number > 0 else None
