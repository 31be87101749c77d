"""A staging folder is removed at the end, and never in the way of what went wrong."""

from __future__ import annotations

from pathlib import Path

import pytest

from storage import _os
from storage.staging import staging_folder


def test_it_is_gone_afterwards(tmp_path: Path) -> None:
    with staging_folder(tmp_path, durable=False) as folder:
        (folder / "file").write_text("x")
    assert list((tmp_path / "tmp").iterdir()) == []


def test_it_is_gone_after_an_error(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), staging_folder(tmp_path, durable=False):
        raise RuntimeError
    assert list((tmp_path / "tmp").iterdir()) == []


def test_ctrl_c_is_heard_even_if_the_folder_cannot_be_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A child that is just being killed may still write into it."""

    def fails(path: Path) -> None:
        raise OSError(39, "Directory not empty")

    with pytest.raises(KeyboardInterrupt), staging_folder(tmp_path, durable=False):
        monkeypatch.setattr(_os, "remove_tree", fails)
        raise KeyboardInterrupt
