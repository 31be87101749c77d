"""Find out what a user's path is: photos, a video, a transforms.json or a COLMAP model."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

from flows.wrong_use import WrongUse
from storage import SourceFile
from storage.formats.archive_name import archive_stem, is_archive
from storage.formats.cameras import camera_files, colmap_folder
from storage.formats.errors import UnreadableInput
from storage.formats.member_name import is_inside
from storage.formats.photos import photo_paths, photo_size
from tasks.ingest import CaptureSource

VIDEO_SUFFIXES = (".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm")


@dataclass(frozen=True)
class FoundCapture:
    """A capture as found on disk, hashed but not decoded.

    ``sizes`` are the photos' (width, height), empty for a video, whose frames are not
    known yet. ``unused_cameras`` lie beside the photos but were not asked for, nor were
    ``unused_targets``.
    """

    name: str
    source: CaptureSource
    sizes: dict[str, tuple[int, int]]
    targets_file: Path | None
    unused_cameras: Path | None
    unused_targets: Path | None = None


def find_capture(path: Path, cameras: Path | None) -> FoundCapture:
    """Look at a user's path; raise WrongUse or UnreadableInput for what is no capture."""
    if path.is_file() and is_archive(path):
        return _in_archive(path, cameras)
    if path.is_file() and path.suffix.lower() in VIDEO_SUFFIXES:
        if cameras is not None:
            raise WrongUse("a video's frames have no known cameras: leave --cameras out")
        source = CaptureSource("video", (SourceFile.of(path),))
        return FoundCapture(path.stem, source, {}, _if_file(path.with_suffix(".json")), None)
    if path.is_file() and path.suffix.lower() == ".json":
        return _photos(path.parent.resolve(), _photos_of_transforms(path), cameras or path)
    if path.is_file():
        raise WrongUse(
            f"{path} is no capture: give a folder of photos, a video, a transforms.json, a "
            "COLMAP model, or a .zip or .tar.gz of one of these"
        )
    model = None if (path / "images").is_dir() else colmap_folder(path)
    if model is not None:
        return _photos(path.resolve(), _photos_beside_model(model), cameras or model)
    return _photos(path.resolve(), photo_paths(path), cameras)


def capture_name(path: Path) -> str:
    """Return the name that a scene of this capture has, whether or not it can be read."""
    if path.is_file() and is_archive(path):
        return archive_stem(path)
    if path.is_file() and path.suffix.lower() in VIDEO_SUFFIXES:
        return path.stem
    place = path.resolve()
    return place.parent.name if path.is_file() else place.name


def _in_archive(path: Path, cameras: Path | None) -> FoundCapture:
    from flows.unpacked import unpacked

    found = find_capture(unpacked(path), cameras)
    return dataclasses.replace(found, name=archive_stem(path))


def _photos(folder: Path, photos: list[Path], cameras: Path | None) -> FoundCapture:
    if len(photos) < 2:
        raise UnreadableInput(
            f"only one photo in {photos[0].parent}: depth needs at least 3 photos from "
            "different places; take 10 to 60 around the objects"
        )
    for photo in photos:
        if not is_inside(photo.name):
            raise UnreadableInput(
                f"the photo {photo.name!r} has a backslash or a control character in its name, "
                "or too long a name: rename it"
            )
    known = tuple(SourceFile.of(file) for file in camera_files(cameras)) if cameras else ()
    source = CaptureSource("photos", tuple(SourceFile.of(photo) for photo in photos), known)
    return FoundCapture(
        folder.name,
        source,
        {photo.name: photo_size(photo) for photo in photos},
        _if_file(folder / "targets.json"),
        None if cameras else _cameras_beside(folder),
    )


def _photos_of_transforms(path: Path) -> list[Path]:
    from storage.formats.nerfstudio import read_transforms

    photos = list(read_transforms(path)[1])
    missing = [photo for photo in photos if not photo.is_file()]
    if missing:
        raise UnreadableInput(
            f"{path} names {missing[0].name}, which is not there ({len(missing)} of "
            f"{len(photos)} photos are missing): copy the photos to {missing[0].parent}"
        )
    return photos


def _photos_beside_model(model: Path) -> list[Path]:
    for place in (model, *list(model.parents)[:3]):
        if (place / "images").is_dir():
            return photo_paths(place / "images")
    raise WrongUse(f"no images/ folder with the photos beside the COLMAP model {model}")


def _cameras_beside(folder: Path) -> Path | None:
    transforms = folder / "transforms.json"
    return transforms if transforms.is_file() else colmap_folder(folder)


def _if_file(path: Path) -> Path | None:
    return path if path.is_file() else None
