"""A full disk is a clear error; what had been computed stays."""

from __future__ import annotations

import errno
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from flows.command import main
from storage import Store, _os


def test_a_full_disk_is_said_and_nothing_half_written_stays(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    photos = tmp_path / "desk"
    photos.mkdir()
    rng = np.random.default_rng(0)
    for name in ("a.png", "b.png", "c.png"):
        Image.fromarray(rng.integers(0, 256, (60, 80, 3)).astype(np.uint8)).save(photos / name)
    Store.open(tmp_path / "store")

    class Full(_os.FileSystem):
        def write(self, path: Path, data: bytes | memoryview) -> None:
            raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(_os, "active", Full())
        code = main(
            ["factorize", str(photos), "--engine", "local", "--store", str(tmp_path / "store"),
             "--out", str(tmp_path / "scenes")]
        )  # fmt: skip
    said = capsys.readouterr().err
    assert code == 1
    assert "space" in said
    assert not list(Store.open(tmp_path / "store").verify())
