"""From a video come sharp frames, spread over it, each showing something new."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from storage.formats.errors import UnreadableInput
from storage.formats.video import read_frames, sharpness


def write_video(path: Path, frames: list[np.ndarray]) -> Path:
    height, width = frames[0].shape[:2]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 30, (width, height))
    for frame in frames:
        writer.write(frame)
    writer.release()
    return path


def panning(count: int) -> list[np.ndarray]:
    rng = np.random.default_rng(0)
    wall = cv2.GaussianBlur(rng.integers(0, 256, (240, 2400, 3)).astype(np.uint8), (5, 5), 0)
    return [wall[:, 10 * i : 10 * i + 320].copy() for i in range(count)]


def test_frames_are_spread_and_in_order(tmp_path: Path) -> None:
    path = write_video(tmp_path / "pan.avi", panning(60))
    frames = read_frames(path, 10, 1600)
    indices = [int(frame.name[6:12]) for frame in frames]
    assert len(frames) == 10
    assert indices == sorted(indices)
    assert max(np.diff(indices)) <= 12
    assert frames[0].original_size == (320, 240)


def test_the_sharp_frame_of_a_stretch_is_picked(tmp_path: Path) -> None:
    frames = panning(40)
    blurred = [f if i % 4 == 0 else cv2.GaussianBlur(f, (15, 15), 0) for i, f in enumerate(frames)]
    path = write_video(tmp_path / "shaky.avi", blurred)
    assert all(int(f.name[6:12]) % 4 == 0 for f in read_frames(path, 10, 1600))


def test_a_pause_gives_one_frame(tmp_path: Path) -> None:
    moving = panning(40)
    path = write_video(tmp_path / "pause.avi", moving[:20] + [moving[20]] * 60 + moving[20:])
    indices = [int(f.name[6:12]) for f in read_frames(path, 24, 1600)]
    assert sum(21 <= i < 80 for i in indices) <= 1


def test_a_still_video_is_refused_with_the_remedy(tmp_path: Path) -> None:
    path = write_video(tmp_path / "still.avi", panning(1) * 30)
    with pytest.raises(UnreadableInput, match="walking around"):
        read_frames(path, 10, 1600)


def test_a_file_that_is_no_video_is_named(tmp_path: Path) -> None:
    path = tmp_path / "notes.mp4"
    path.write_bytes(b"not a video")
    with pytest.raises(UnreadableInput, match=r"notes\.mp4"):
        read_frames(path, 10, 1600)


def test_blur_lowers_sharpness() -> None:
    grey = np.random.default_rng(0).integers(0, 256, (64, 64)).astype(np.uint8)
    assert sharpness(cv2.GaussianBlur(grey, (9, 9), 0)) < sharpness(grey)
