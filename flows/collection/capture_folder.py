"""Find the captures in a folder: its sub-folders and videos."""

from __future__ import annotations

from pathlib import Path

from flows.capture import VIDEO_SUFFIXES, capture_name
from flows.preset import Preset
from flows.scene_request import SceneOptions
from flows.wrong_use import WrongUse
from storage.formats.cameras import colmap_folder
from storage.formats.photos import SUFFIXES, natural_key


def read_folder(
    folder: Path, out: Path, preset: Preset
) -> tuple[list[tuple[str, SceneOptions]], tuple[str, ...]]:
    """Return the captures' names and options, and a remark on each sub-folder that is none.

    A sub-folder is a capture if there are photos in it or in its ``images/``, a COLMAP
    model, else one video, else a ``transforms.json``. Raises WrongUse if there is none.
    """
    entries: dict[str, SceneOptions] = {}
    remarks = []
    for place in sorted(folder.iterdir(), key=lambda p: natural_key(p.name)):
        if place.resolve() == out.resolve() or not (place.is_dir() or _is_video(place)):
            continue
        capture = _capture_in(place)
        if capture is None:
            remarks.append(f"{place} is skipped: it holds no photos and no video")
            continue
        name = place.name if place.is_dir() else capture_name(place)
        if name in entries:
            raise WrongUse(
                f"two captures in {folder} are called {name}: {entries[name].capture} and"
                f" {capture}; rename one"
            )
        entries[name] = SceneOptions(capture, out, preset)
    if not entries:
        raise WrongUse(_none_found(folder))
    return list(entries.items()), tuple(remarks)


def _capture_in(place: Path) -> Path | None:
    """Return what ``find_capture`` takes: the place itself, or the one file inside."""
    if not place.is_dir() or _has_photos(place) or colmap_folder(place) is not None:
        return place
    videos = [file for file in place.iterdir() if _is_video(file)]
    if len(videos) == 1:
        return videos[0]
    transforms = place / "transforms.json"
    return transforms if transforms.is_file() else None


def _has_photos(folder: Path) -> bool:
    inner = folder / "images"
    place = inner if inner.is_dir() else folder
    return any(p.suffix.lower() in SUFFIXES and p.is_file() for p in place.iterdir())


def _is_video(path: Path) -> bool:
    return path.suffix.lower() in VIDEO_SUFFIXES and path.is_file()


def _none_found(folder: Path) -> str:
    if _has_photos(folder):
        return f"{folder} is itself a capture: use `garden factorize {folder}`"
    return f"no sub-folder of {folder} is a capture: put one folder of photos a scene into it"
