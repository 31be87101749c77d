from __future__ import annotations

from pathlib import Path

import pytest

from storage import Store
from tasks.model.resident import residents
from tests.tasks.model.doubler import put_weights
from tests.tasks.model.registered import MODELS, register_for


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store.open(tmp_path / "store", durability="none")


@pytest.fixture
def models(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Register the test models, with weights in a folder of their own; give that folder."""
    register_for(monkeypatch)
    for name in MODELS:
        put_weights(tmp_path / "weights" / name, 2.0 if name == "doubler" else 3.0)
    monkeypatch.setenv("GARDEN_WEIGHTS", str(tmp_path / "weights"))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("GARDEN_MODELS", raising=False)
    residents.free()
    return tmp_path / "weights"
