"""Register the test models: for one test here, and for good in the processes that it starts."""

from __future__ import annotations

import os

import pytest

from garden_models import foundation

MODELS = {name: f"tests.tasks.model.{name}" for name in ("doubler", "tripler")}
_VARIABLE = "GARDEN_TEST_MODELS"


def register_for(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, module in MODELS.items():
        monkeypatch.setitem(foundation.ADAPTERS, name, module)
    monkeypatch.setenv(_VARIABLE, "1")


def register_if_told() -> None:
    """Called by modules that a started process imports."""
    if os.environ.get(_VARIABLE):
        foundation.ADAPTERS.update(MODELS)
