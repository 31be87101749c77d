"""A deployed capture answers wrong use with a failed state, as the command does with exit 2."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from flows.deployed.capture import factorize_capture


@pytest.mark.parametrize(
    ("arguments", "mention"),
    [((), "no photos in"), (("--boxx", "1"), "--boxx"), (("--preset", "fast"), "fast")],
)
def test_wrong_use_says_what_to_correct(
    tmp_path: Path, arguments: tuple[str, ...], mention: str
) -> None:
    (tmp_path / "desk").mkdir()
    state: Any = factorize_capture.fn(
        str(tmp_path / "desk"), str(tmp_path / "out"), None, arguments
    )
    assert state.name == "Failed"
    assert mention in state.message
    assert not (tmp_path / "out").exists()
