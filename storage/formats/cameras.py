"""Find and read a user's file of known cameras, whichever format it has."""

from __future__ import annotations

from pathlib import Path

from storage.formats.errors import UnreadableInput
from storage.formats.posed_camera import PosedCamera

COLMAP_FILES = ("cameras", "images", "points3D", "rigs", "frames")
COLMAP_SUFFIXES = (".bin", ".txt")


def camera_files(path: Path) -> tuple[Path, ...]:
    """Return the files that hold the cameras: a ``transforms.json``, or a COLMAP model's.

    Raises UnreadableInput if ``path`` is neither.
    """
    if path.is_file() and path.suffix.lower() == ".json":
        return (path,)
    model = colmap_folder(path)
    if model is not None:
        names = [f"{stem}{suffix}" for stem in COLMAP_FILES for suffix in COLMAP_SUFFIXES]
        return tuple(model / name for name in names if (model / name).is_file())
    if not path.exists():
        raise UnreadableInput(f"no such file of cameras: {path}; check the path")
    raise UnreadableInput(
        f"{path} holds no cameras: give a nerfstudio transforms.json or a COLMAP model's folder"
    )


def colmap_folder(path: Path) -> Path | None:
    """Return the folder with COLMAP's files: ``path`` itself or its ``sparse/0``."""
    for place in (path, path / "sparse" / "0", path / "sparse"):
        if any((place / f"cameras{suffix}").is_file() for suffix in COLMAP_SUFFIXES):
            return place
    return None


def read_cameras(files: tuple[Path, ...]) -> tuple[PosedCamera, ...]:
    """Read the cameras from the files that ``camera_files`` found."""
    if files[0].suffix.lower() == ".json":
        from storage.formats.nerfstudio import read_transforms_cameras

        return read_transforms_cameras(files[0])
    from storage.formats.colmap import read_model

    return read_model(files[0].parent)
