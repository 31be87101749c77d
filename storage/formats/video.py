"""Pick sharp, spread frames from a video."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from storage.formats.errors import UnreadableInput
from storage.formats.limits import check_file_size
from storage.formats.photos import PhotoFile

SUFFIXES = (".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm")
LOOKED_AT = 600
"""Frames that are decoded and judged at most, evenly over the video."""

THUMBNAIL = 320
"""Long side in pixels at which sharpness and motion are judged."""

MAX_BYTES = 20_000_000_000
MAX_PIXELS = 40_000_000
"""Of one frame; 8K has 33 million."""

MAX_FRAMES = 216_000
"""An hour at 60 frames a second; all frames up to the last are decoded."""

STILL_SHARE = 0.004
"""Mean motion, as a share of the picture's width, under which two frames show the same."""


@dataclass(frozen=True)
class _Frame:
    index: int
    sharpness: float
    grey: UInt8[np.ndarray, "h w"]


def read_frames(path: Path, count: int, max_size: int) -> tuple[PhotoFile, ...]:
    """Return up to ``count`` frames: the sharpest of each of ``count`` equal stretches.

    A frame that shows the same as the one picked before is left out. Frames are named
    ``frame_000123.png`` by their number in the video. Raises UnreadableInput.
    """
    looked_at = _look(path)
    stretches = np.array_split(np.arange(len(looked_at)), min(count, len(looked_at)))
    picked: list[_Frame] = []
    for stretch in stretches:
        best = max((looked_at[i] for i in stretch), key=lambda frame: frame.sharpness)
        if not picked or _motion(picked[-1].grey, best.grey) > STILL_SHARE:
            picked.append(best)
    if len(picked) < 2:
        raise UnreadableInput(
            f"{path} shows almost no motion: record it while walking around the objects"
        )
    wanted = {frame.index for frame in picked}
    return tuple(_photo(i, bgr, max_size) for i, bgr in _decode(path, wanted))


def sharpness(grey: UInt8[np.ndarray, "h w"]) -> float:
    """Return the variance of the Laplacian (Pech-Pacheco et al. 2000)."""
    return float(cv2.Laplacian(grey, cv2.CV_64F).var())


def _look(path: Path) -> list[_Frame]:
    total = _frame_count(path)
    step = max(1, total // LOOKED_AT)
    frames = []
    for index, bgr in _decode(path, set(range(0, total, step))):
        scale = THUMBNAIL / max(bgr.shape[:2])
        small = cv2.resize(bgr, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        grey = cv2.cvtColor(small, cv2.COLOR_BGR2GRAY)
        frames.append(_Frame(index, sharpness(grey), grey))
    if len(frames) < 2:
        raise UnreadableInput(f"{path} has fewer than two readable frames: export it again as MP4")
    return frames


def _frame_count(path: Path) -> int:
    if not path.is_file():
        raise UnreadableInput(f"no such video: {path}; check the path")
    check_file_size(path, MAX_BYTES, "a video")
    capture = _open(path)
    try:
        if not capture.isOpened():
            raise UnreadableInput(f"{path} cannot be read as a video: export it as MP4 (H.264)")
        width, height, frames = (
            int(capture.get(what))
            for what in (
                cv2.CAP_PROP_FRAME_WIDTH,
                cv2.CAP_PROP_FRAME_HEIGHT,
                cv2.CAP_PROP_FRAME_COUNT,
            )
        )
    finally:
        capture.release()
    if width * height > MAX_PIXELS:
        raise UnreadableInput(
            f"{path} has frames of {width} x {height} pixels (at most {MAX_PIXELS / 1e6:.0f} "
            "megapixels): export it with a smaller resolution"
        )
    if frames > MAX_FRAMES:
        raise UnreadableInput(
            f"{path} has {frames} frames (at most {MAX_FRAMES}): cut out the part that shows "
            "the room"
        )
    return frames


def _open(path: Path) -> cv2.VideoCapture:
    """Open a file with FFmpeg alone: other readers take a name for a pattern or an address."""
    return cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)


def _decode(path: Path, wanted: set[int]) -> Iterator[tuple[int, UInt8[np.ndarray, "h w 3"]]]:
    """Decode in order (seeking is unreliable in many containers) and give what is wanted."""
    capture = _open(path)
    try:
        for index in range(max(wanted, default=-1) + 1):
            if not capture.grab():
                break
            if index in wanted:
                ok, bgr = capture.retrieve()
                if ok:
                    yield index, bgr
    finally:
        capture.release()


def _motion(a: UInt8[np.ndarray, "h w"], b: UInt8[np.ndarray, "h w"]) -> float:
    """Return the median optical flow between two frames as a share of the width."""
    flow: Float[np.ndarray, "h w 2"] = cv2.calcOpticalFlowFarneback(
        a, b, None, 0.5, 4, 21, 3, 5, 1.1, 0
    )
    return float(np.median(np.linalg.norm(flow, axis=2))) / a.shape[1]


def _photo(index: int, bgr: UInt8[np.ndarray, "h w 3"], max_size: int) -> PhotoFile:
    height, width = bgr.shape[:2]
    factor = min(1.0, max_size / max(width, height))
    size = (max(1, round(width * factor)), max(1, round(height * factor)))
    resized = bgr if factor == 1.0 else cv2.resize(bgr, size, interpolation=cv2.INTER_AREA)
    rgb = np.ascontiguousarray(resized[..., ::-1])
    return PhotoFile(f"frame_{index:06d}.png", rgb, (width, height), None)
