"""Weight files: what is missing is named, and their content is part of a step's key."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path
from typing import Any

import pytest

from garden_models.scene import BadInput
from tasks.model import backend_of, weights, weights_of
from tasks.model.settings import settings_file
from tasks.model.weights import stamp_of, weight_files
from tests.tasks.model import doubler


@pytest.fixture
def hashed(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """List the files that are really hashed."""
    seen: list[str] = []
    digest = weights.digest_file

    def counted(path: Path) -> str:
        seen.append(path.name)
        return digest(path)

    monkeypatch.setattr(weights, "digest_file", counted)
    return seen


def age(folder: Path) -> None:
    """Let no file look as if it were being written."""
    for path in folder.rglob("*"):
        os.utime(path, (1e9, 1e9))


def test_files_and_folders_are_found_by_their_place(models: Path) -> None:
    assert weight_files("doubler") == {
        "factor.txt": models / "doubler/factor.txt",
        "more/a.bin": models / "doubler/more/a.bin",
    }


@pytest.mark.parametrize("missing", ["factor.txt", "more/a.bin"])
def test_a_missing_file_is_named_with_its_place(models: Path, missing: str) -> None:
    (models / "doubler" / missing).unlink()
    place = models / "doubler" / missing.removesuffix("a.bin")
    with pytest.raises(BadInput) as caught:
        weights_of("doubler")
    assert f"put them at {place}" in str(caught.value)


def test_digests_follow_the_content_and_are_made_once(models: Path, hashed: list[str]) -> None:
    age(models)
    first = weights_of("doubler")
    assert first.keys() == {"factor.txt", "more/a.bin", "adapter"}
    assert weights_of("doubler") == first
    assert hashed == ["factor.txt", "a.bin"]
    (models / "doubler/factor.txt").write_text("2.5")
    changed = weights_of("doubler")
    assert changed["factor.txt"] != first["factor.txt"]
    assert changed["more/a.bin"] == first["more/a.bin"]
    assert hashed == ["factor.txt", "a.bin", "factor.txt"]


def test_a_file_that_may_still_be_written_is_hashed_again(models: Path, hashed: list[str]) -> None:
    weights_of("doubler")
    weights_of("doubler")
    assert hashed == ["factor.txt", "a.bin"] * 2


def test_a_replaced_file_of_the_same_size_and_time_is_seen(models: Path) -> None:
    age(models)
    first, stamp = weights_of("doubler"), stamp_of("doubler")
    other = models / "other"
    other.write_text("9.0")
    os.utime(other, (1e9, 1e9))
    other.replace(models / "doubler/factor.txt")
    assert weights_of("doubler")["factor.txt"] != first["factor.txt"]
    assert stamp_of("doubler") != stamp


@pytest.mark.parametrize("kept", [b"", b"not JSON", b"[1]"])
def test_lost_digests_are_made_again(models: Path, tmp_path: Path, kept: bytes) -> None:
    age(models)
    first = weights_of("doubler")
    (tmp_path / "cache/garden/weight_digests.json").write_bytes(kept)
    assert weights_of("doubler") == first


def test_the_adapters_code_counts(models: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def other_code(_module: str) -> Any:
        return type("Code", (), {"digest": "b3:other"})

    first = weights_of("doubler")
    monkeypatch.setattr(weights, "code_of", other_code)
    assert weights_of("doubler") != first


def test_the_precision_counts(models: Path) -> None:
    first = weights_of("doubler")
    settings_file().parent.mkdir(parents=True)
    settings_file().write_text('[doubler]\ndtype = "bfloat16"')
    assert weights_of("doubler") == first | {"dtype": "bfloat16"}


def test_the_variant_is_part_of_the_backends_name(
    models: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert backend_of("doubler") == "doubler"
    monkeypatch.setattr(
        doubler, "CARD", dataclasses.replace(doubler.CARD, variant_key="model_name")
    )
    assert backend_of("doubler") == "doubler"
    (models / "doubler/config.json").write_text('{"model_name": "giant"}')
    assert backend_of("doubler") == "doubler/giant"
