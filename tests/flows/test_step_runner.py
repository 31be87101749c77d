"""The runner is chosen by name; what cannot be used is wrong use, said before any work."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from flows.command import main
from flows.step_runner import step_runner
from flows.wrong_use import WrongUse
from storage import Store
from tasks.step import dask_runner


def test_without_a_runner_steps_are_computed_here(tmp_path: Path) -> None:
    with step_runner(None, Store.open(tmp_path / "store")) as elsewhere:
        assert elsewhere is None


@pytest.mark.parametrize("runner", ["dask", "dask:", "dask:host:8786", "ray:tcp://host", "tcp://h"])
def test_an_unknown_runner_is_wrong_use(tmp_path: Path, runner: str) -> None:
    store = Store.open(tmp_path / "store")
    with pytest.raises(WrongUse, match="dask:tcp://HOST:PORT"), step_runner(runner, store):
        pass


def test_a_scheduler_that_does_not_answer_is_wrong_use(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("a.png", "b.png"):
        Image.fromarray(np.zeros((60, 80, 3), np.uint8)).save(tmp_path / name)
    monkeypatch.setattr(dask_runner, "_CONNECT_S", 0.5)
    code = main(
        ["factorize", str(tmp_path), "--engine", "local", "--store", str(tmp_path / "store"),
         "--out", str(tmp_path / "out"), "--runner", "dask:tcp://127.0.0.1:9"]
    )  # fmt: skip
    assert code == 2
    assert "no Dask scheduler answers at tcp://127.0.0.1:9" in capsys.readouterr().err
    assert list(Store.open(tmp_path / "store").actions()) == []
