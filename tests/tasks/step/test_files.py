"""Changed files are told by name: in a comparison, in a plan, and after a run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from storage import SourceFile, Store
from tasks.step import step
from tasks.step.files import counted, file_changes, split_files
from tests.tasks.step.toy import Numbers, Scaling, in_run, scale

BEFORE = {"IMG_1.jpg": "b3:1", "IMG_2.jpg": "b3:2", "IMG_3.jpg": "b3:3"}


def leaves(files: dict[str, str]) -> dict[str, object]:
    """Return what an action record keeps of a list of files, and of a setting beside it."""
    kept: dict[str, object] = {"config.max_size": 1600}
    for i, (name, digest) in enumerate(files.items()):
        kept |= {f"source.files.{i}.name": name, f"source.files.{i}.digest": digest}
        kept |= {f"source.files.{i}.size": len(digest)}
    return kept


@pytest.mark.parametrize(
    ("after", "told"),
    [
        (BEFORE, []),
        (BEFORE | {"IMG_3.jpg": "b3:9"}, ["photo IMG_3.jpg changed"]),
        (BEFORE | {"a.jpg": "b3:4", "b.jpg": "b3:5"}, ["2 photos added: a.jpg, b.jpg"]),
        ({"IMG_0.jpg": "b3:0"} | BEFORE, ["photo IMG_0.jpg added"]),
        ({"IMG_3.jpg": "b3:3"}, ["2 photos removed: IMG_1.jpg, IMG_2.jpg"]),
        (
            {"IMG_1.jpg": "b3:1", "two.jpg": "b3:2", "IMG_3.jpg": "b3:9"},
            ["photo IMG_3.jpg changed", "1 photo renamed: IMG_2.jpg -> two.jpg"],
        ),
        (dict(reversed(BEFORE.items())), ["the files are in another order"]),
        (
            BEFORE | {f"n{i}.png": f"b3:n{i}" for i in range(12)},
            ["12 photos added: n0.png, n1.png, n2.png and 9 more"],
        ),
        (BEFORE | {"cameras.txt": "b3:c"}, ["file cameras.txt added"]),
        (BEFORE | {"walk.mp4": "b3:v"}, ["video walk.mp4 added"]),
    ],
)
def test_files_are_compared_by_name(after: dict[str, str], told: list[str]) -> None:
    assert file_changes(leaves(BEFORE), leaves(after)) == told


def test_files_are_told_apart_from_other_leaves() -> None:
    files, rest = split_files(leaves(BEFORE) | {"model.digest": "b3:x"})
    assert files == BEFORE
    assert rest == {"config.max_size": 1600, "model.digest": "b3:x"}
    assert counted(list(files)) == "3 photos"


@step(version=1)
def read(files: tuple[SourceFile, ...], config: Scaling) -> Numbers:
    return Numbers(np.array([Path(file.path).stat().st_size for file in files], dtype=float))


def test_explained_changed_photos_are_named(store: Store, tmp_path: Path) -> None:
    def photos() -> tuple[SourceFile, ...]:
        return tuple(SourceFile.of(path) for path in sorted(tmp_path.glob("*.jpg")))

    for name in "abc":
        (tmp_path / f"{name}.jpg").write_bytes(name.encode())
    in_run(store, lambda: scale(read(photos(), Scaling()), Scaling()))
    (tmp_path / "b.jpg").write_bytes(b"other")
    (tmp_path / "0.jpg").write_bytes(b"first")
    _, context = in_run(store, lambda: scale(read(photos(), Scaling(3.0)), Scaling()), "plan")
    told = [(entry.step, entry.why.code, entry.why.sentence) for entry in context.plan]
    changes = "photo b.jpg changed; photo 0.jpg added; config.factor 2.0 -> 3.0"
    assert told == [("read", "input", changes), ("scale", "upstream", "read would run first")]
