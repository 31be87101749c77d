"""What workers print has a place, also on a machine without a cache."""

from __future__ import annotations

from pathlib import Path

import pytest

from tasks.model.log import log_file, model_log


def test_lines_carry_the_models_name(models: Path) -> None:
    model_log("sam3").info("%s", "loading weights")
    model_log("vggt").info("%s", "ready")
    lines = log_file().read_text().splitlines()
    assert [line.split(" ", 3)[3] for line in lines] == [
        "garden.model.sam3 loading weights",
        "garden.model.vggt ready",
    ]


def test_without_a_cache_they_go_to_standard_error(
    models: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    for _ in range(2):
        model_log("sam3").info("%s", "loading weights")
    assert capsys.readouterr().err.count("garden.model.sam3 loading weights") == 2
