"""`garden plan` and `garden why` name the photos that changed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from flows.capture import find_capture
from flows.command import main
from storage import Store
from tasks.ingest import Ingest, ingest
from tasks.step import RunContext, run_context


def write_photo(path: Path, grey: int) -> None:
    Image.fromarray(np.full((60, 80, 3), grey, np.uint8)).save(path)


def take_in(folder: Path, store: Path) -> None:
    with run_context(RunContext(Store.open(store), scene=folder.name)):
        ingest(find_capture(folder, None).source, Ingest())


def test_plan_and_why_name_changed_photos(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    folder, store = tmp_path / "desk", tmp_path / "store"
    folder.mkdir()
    for i in range(4):
        write_photo(folder / f"IMG_{i}.jpg", 40 * i)
    take_in(folder, store)
    write_photo(folder / "IMG_3.jpg", 200)
    write_photo(folder / "IMG_8.jpg", 210)
    write_photo(folder / "IMG_9.jpg", 220)
    changes = "photo IMG_3.jpg changed; 2 photos added: IMG_8.jpg, IMG_9.jpg"

    assert main(["plan", str(folder), "--store", str(store), "--json"]) == 0
    first = json.loads(capsys.readouterr().out)["steps"][0]
    assert (first["step"], first["why_code"], first["why"]) == ("ingest", "input", changes)

    take_in(folder, store)
    assert main(["why", "ingest", "--store", str(store)]) == 0
    told = capsys.readouterr().out
    assert changes in told
    assert "6 photos: IMG_0.jpg, IMG_1.jpg, IMG_2.jpg and 3 more" in told
    assert "digest" not in told
