"""Bad input is answered by one sentence that names the file and the remedy; nothing is lost."""

from __future__ import annotations

import errno
import json
import struct
import tempfile
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from flows.command import main

MUG = {"name": "mug", "image": "a.jpg", "box": [10, 10, 60, 60]}


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    folder = tmp_path / "desk"
    folder.mkdir()
    rng = np.random.default_rng(0)
    for name in ("a.jpg", "b.jpg", "c.jpg"):
        pixels = rng.integers(0, 256, (80, 120, 3)).astype(np.uint8)
        Image.fromarray(pixels).save(folder / name)
    return folder


def answer(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, *arguments: str | Path
) -> tuple[int, str]:
    """Run the command without Prefect; return its exit code and what it said."""
    code = main(
        ["factorize", *map(str, arguments), "--engine", "local",
         "--store", str(tmp_path / "store"), "--out", str(tmp_path / "scenes")]
    )  # fmt: skip
    return code, capsys.readouterr().err


def with_targets(capture: Path, *targets: dict[str, object]) -> Path:
    (capture / "targets.json").write_text(json.dumps({"targets": list(targets)}))
    return capture


def test_no_such_folder(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    code, said = answer(capsys, tmp_path, tmp_path / "nowhere")
    assert code == 2
    assert "nowhere" in said


def test_no_photos(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    code, said = answer(capsys, tmp_path, tmp_path / "empty")
    assert code == 2
    assert "empty" in said
    assert "photo" in said


def test_one_photo(capsys: pytest.CaptureFixture[str], tmp_path: Path, capture: Path) -> None:
    (capture / "b.jpg").unlink()
    (capture / "c.jpg").unlink()
    code, said = answer(capsys, tmp_path, capture)
    assert code != 0
    assert "1 photo" in said or "one photo" in said


def test_a_truncated_photo_among_good_ones_is_named(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, capture: Path
) -> None:
    whole = (capture / "b.jpg").read_bytes()
    (capture / "b.jpg").write_bytes(whole[: len(whole) // 2])
    code, said = answer(capsys, tmp_path, capture)
    assert code != 0
    assert "b.jpg" in said


@pytest.mark.parametrize(
    ("target", "mention"),
    [
        ({**MUG, "box": [10, 10, 500, 60]}, "mug"),
        ({**MUG, "box": [10, 10, 10, 60]}, "mug"),
        ({**MUG, "box": [60, 10, 10, 60]}, "mug"),
        ({**MUG, "image": "z.jpg"}, "z.jpg"),
        ({**MUG, "name": "../mug"}, "../mug"),
    ],
    ids=["outside its photo", "no area", "corners swapped", "missing photo", "unsafe name"],
)
def test_a_target_that_cannot_be(
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    capture: Path,
    target: dict[str, object],
    mention: str,
) -> None:
    code, said = answer(capsys, tmp_path, with_targets(capture, target))
    assert code == 2
    assert mention in said
    assert not list(tmp_path.glob("scenes/*"))


def test_two_targets_of_one_name(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, capture: Path
) -> None:
    code, said = answer(capsys, tmp_path, with_targets(capture, MUG, MUG))
    assert code == 2
    assert "mug" in said


def test_a_scene_name_cannot_leave_its_folder(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, capture: Path
) -> None:
    code, said = answer(capsys, tmp_path, capture, "--name", "../elsewhere")
    assert code == 2
    assert "../elsewhere" in said


def test_a_gigapixel_image_is_refused_before_it_is_decoded(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, capture: Path
) -> None:
    (capture / "bomb.png").write_bytes(_png_of_size(40_000, 40_000))
    code, said = answer(capsys, tmp_path, capture)
    assert code != 0
    assert "bomb.png" in said


def test_an_output_folder_that_cannot_be_written(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, capture: Path
) -> None:
    (tmp_path / "scenes").write_text("a file where the folder should be")
    code, said = answer(capsys, tmp_path, capture)
    assert code == 1
    assert "scenes" in said
    assert "--out" in said


def test_a_read_only_output_folder(
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    capture: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Root may write to folders of mode 0555, so the file system itself refuses here."""
    making = tempfile.mkdtemp

    def refuse(*arguments: object, **named: object) -> str:
        if tmp_path / "scenes" in (*arguments, named.get("dir")):
            raise OSError(errno.EROFS, "Read-only file system")
        return making(*arguments, **named)  # type: ignore[arg-type]

    monkeypatch.setattr(tempfile, "mkdtemp", refuse)
    code, said = answer(capsys, tmp_path, capture)
    assert code == 1
    assert "cannot be written to" in said
    assert "--out" in said


def test_an_unknown_option_of_a_step_names_the_known_ones(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, capture: Path
) -> None:
    code, said = answer(capsys, tmp_path, capture, "--set", "reconstruct.size=2")
    assert code == 2
    assert "long_side" in said


def test_json_mode_answers_errors_as_json(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    code = main(["factorize", str(tmp_path / "nowhere"), "--json"])
    document = json.loads(capsys.readouterr().out)
    assert code == 2
    assert document["status"] == "failed"
    assert "nowhere" in document["reasons"][0]


def _png_of_size(width: int, height: int) -> bytes:
    """Return a small PNG file whose header announces a huge picture."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + chunk(b"IDAT", zlib.compress(b"\0" * 1000))
        + chunk(b"IEND", b"")
    )
