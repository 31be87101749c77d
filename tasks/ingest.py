"""Read a capture: photos upright, focal lengths, sharp frames of a video, known cameras.

Inputs are the user's files, named by their content. Fails on a file that cannot be
decoded, naming it. Seconds, bound by the disk.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from garden_models.geometry.camera import resize_intrinsics
from garden_models.progress import Progress, silent
from garden_models.scene import BadInput, Capture, KnownCamera, Photo
from storage import SourceFile
from tasks.step import step

if TYPE_CHECKING:
    from storage.formats.photos import PhotoFile
    from storage.formats.posed_camera import PosedCamera


@dataclass(frozen=True)
class Ingest:
    """How photos are taken in."""

    max_size: int = 1600
    """Long side in pixels; larger photos are scaled down."""

    video_frames: int = 40
    """Frames picked from a video."""


@dataclass(frozen=True)
class CaptureSource:
    """The files of a capture: photos, or one video; and the files of known cameras."""

    kind: Literal["photos", "video"]
    files: tuple[SourceFile, ...]
    cameras: tuple[SourceFile, ...] = ()


@step(
    version=1,
    packages=("pillow", "pillow-heif", "opencv-python-headless", "numpy", "pycolmap"),
    here=True,
)
def ingest(source: CaptureSource, config: Ingest, progress: Progress = silent) -> Capture:
    """Return the photos, and their cameras if files of cameras were given."""
    from storage.formats.cameras import read_cameras
    from storage.formats.errors import UnreadableInput

    try:
        files = _read_photos(source, config, progress)
        cameras = read_cameras(_paths(source.cameras)) if source.cameras else ()
    except UnreadableInput as error:
        raise BadInput(str(error)) from error
    photos = tuple(Photo(f.name, f.rgb, f.original_size, f.focal_px) for f in files)
    return Capture(photos, _known_cameras(photos, cameras))


def _read_photos(
    source: CaptureSource, config: Ingest, progress: Progress
) -> tuple[PhotoFile, ...]:
    if source.kind == "video":
        from storage.formats.video import read_frames

        return read_frames(Path(source.files[0].path), config.video_frames, config.max_size)
    from storage.formats.photos import read_photo

    photos = []
    for i, path in enumerate(_paths(source.files)):
        progress(i / len(source.files), path.name)
        photos.append(read_photo(path, config.max_size))
    return tuple(photos)


def _known_cameras(
    photos: tuple[Photo, ...], cameras: tuple[PosedCamera, ...]
) -> tuple[KnownCamera, ...]:
    """Match cameras to photos by name and scale their intrinsics to the ingested size."""
    by_name = {camera.photo: camera for camera in cameras}
    known = []
    for photo in photos:
        camera = by_name.get(photo.name)
        if camera is None:
            continue
        size = (photo.rgb.shape[1], photo.rgb.shape[0])
        if not np.isclose(camera.size[0] / camera.size[1], size[0] / size[1], rtol=0.01):
            raise BadInput(
                f"the camera of {photo.name} is for {camera.size[0]} x {camera.size[1]} pixels, "
                f"which is another shape than the photo's {photo.original_size[0]} x "
                f"{photo.original_size[1]}: give the cameras of these photos"
            )
        K = resize_intrinsics(camera.K, camera.size, size)
        known.append(KnownCamera(photo.name, K, camera.camera_from_world, camera.distortion))
    if cameras and len(known) < 2:
        raise BadInput(
            f"of {len(cameras)} known cameras {len(known)} belong to a photo of the capture: "
            f"they are named like {cameras[0].photo}, the photos like {photos[0].name}"
        )
    return tuple(known)


def _paths(files: tuple[SourceFile, ...]) -> tuple[Path, ...]:
    return tuple(Path(file.path) for file in files)
