"""Find the scenes of a report: captures, collection files and folders of captures."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from flows.collection.definition import read_collection
from flows.preset import PRESETS, Preset
from flows.scene_request import SceneOptions, read_scene
from flows.scene_run import SceneRequest
from flows.wrong_use import WrongUse
from storage.formats.cameras import colmap_folder
from storage.formats.photos import SUFFIXES

COLLECTION_SUFFIXES = (".toml", ".yaml", ".yml")


@dataclass
class FoundScenes:
    """The scenes to report on, and a sentence on each that cannot be."""

    requests: list[SceneRequest] = field(default_factory=list)
    unreadable: list[str] = field(default_factory=list)


def find_scenes(
    paths: Iterable[Path], packages: Path | None = None, preset: Preset | None = None
) -> FoundScenes:
    """Return the scenes that the paths name.

    Args:
        paths: captures, collection files, folders of captures.
        packages: where the scenes' packages are; what a collection says, or ``scenes``.
        preset: the options of all steps; what a collection says, or ``embedded``.

    Raises:
        WrongUse: there is none, or two have one name.
        BadInput, UnreadableInput: a capture or a collection file cannot be read.
    """
    found = FoundScenes()
    for path in paths:
        if _is_collection(path):
            collection = read_collection(path, out=packages, preset=preset)
            found.requests += collection.scenes
            found.unreadable += [f"{u.name}: {u.reason}" for u in collection.unreadable]
        else:
            options = SceneOptions(path, packages or Path("scenes"), preset or PRESETS["embedded"])
            found.requests.append(read_scene(options))
    names = [request.name for request in found.requests]
    if doubled := sorted({name for name in names if names.count(name) > 1}):
        raise WrongUse(f"two scenes are called {doubled[0]}: report on them one at a time")
    if not names:
        raise WrongUse(
            "no scene to report on: give captures, a collection file or a folder of captures"
        )
    return found


def _is_collection(path: Path) -> bool:
    if path.is_file():
        return path.suffix.lower() in COLLECTION_SUFFIXES
    return path.is_dir() and not _is_capture(path)


def _is_capture(folder: Path) -> bool:
    photos = any(file.suffix.lower() in SUFFIXES for file in folder.iterdir())
    return photos or (folder / "images").is_dir() or colmap_folder(folder) is not None
