"""``garden doctor`` lists the paper's models with their state, terms, and what is missing."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from flows.command import main
from garden_models import foundation
from tests.tasks.model.doubler import put_weights


def test_doctor_lists_the_models(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(foundation.ADAPTERS, "doubler", "tests.tasks.model.doubler")
    monkeypatch.setenv("GARDEN_WEIGHTS", str(tmp_path))
    monkeypatch.delenv("GARDEN_MODELS", raising=False)
    put_weights(tmp_path / "doubler", 2.0)
    store = str(tmp_path / "store")

    main(["doctor", "--store", store, "--json"])
    listed = {m["name"]: m for m in json.loads(capsys.readouterr().out)["models"]}
    assert (listed["doubler"]["state"], listed["doubler"]["problems"]) == ("ready", [])
    assert listed["doubler"]["weights_licence"] == "Apache-2.0"

    (tmp_path / "doubler" / "factor.txt").unlink()
    main(["doctor", "--store", store])
    assert f"put them at {tmp_path / 'doubler' / 'factor.txt'}" in capsys.readouterr().out
