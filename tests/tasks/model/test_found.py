"""What a machine has of a model is told with its terms, and each gap with its remedy."""

from __future__ import annotations

import dataclasses
import json
import shutil
import sys
from pathlib import Path

import pytest

from garden_models.foundation.model_card import Terms
from tasks.model.found import found_model, variant_of
from tests.tasks.model import doubler

FREE = Terms("MIT", "MIT", commercial=True)
BOUND = Terms("MIT", "CC BY-NC 4.0", commercial=False)


def test_a_whole_model_is_ready(models: Path) -> None:
    found = found_model("doubler")
    assert (found.state, found.problems) == ("ready", ())
    assert found.weights == models / "doubler"
    assert found.device == "cpu"
    assert found.digest.startswith("b3:")
    assert found.environment == sys.executable


def test_other_weights_have_another_digest(models: Path) -> None:
    before = found_model("doubler").digest
    (models / "doubler" / "factor.txt").write_text("7")
    assert found_model("doubler").digest != before


def test_missing_weights_are_named_with_their_place(models: Path) -> None:
    (models / "doubler" / "factor.txt").unlink()
    found = found_model("doubler")
    assert found.state == "broken"
    assert str(models / "doubler" / "factor.txt") in found.problems[0]


def test_missing_code_is_named_with_its_remedy(
    models: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    card = dataclasses.replace(
        doubler.CARD, imports=("no_such_module",), install="pip install no-such-module"
    )
    monkeypatch.setattr(doubler, "CARD", card)
    found = found_model("doubler")
    assert found.state == "broken"
    assert "no_such_module" in found.problems[0]
    assert "pip install no-such-module" in found.problems[0]
    shutil.rmtree(models / "doubler")
    assert found_model("doubler").state == "absent"


def test_the_code_is_looked_for_in_the_models_own_environment(
    models: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = tmp_path / "models.toml"
    monkeypatch.setenv("GARDEN_MODELS", str(settings))
    settings.write_text(f"[doubler]\npython = {json.dumps(sys.executable)}\n")
    assert found_model("doubler").state == "ready"
    settings.write_text('[doubler]\npython = "/no/such/python"\n')
    assert "/no/such/python does not run" in found_model("doubler").problems[0]


def test_the_weight_folder_says_which_variant_it_holds(tmp_path: Path) -> None:
    card = dataclasses.replace(
        doubler.CARD, terms=BOUND, variant_key="model_name", variants={"small": FREE}
    )
    assert variant_of(card, tmp_path) is None
    (tmp_path / "config.json").write_text('{"model_name": "small"}')
    assert card.terms_of(variant_of(card, tmp_path)) == FREE
    (tmp_path / "config.json").write_text('{"model_name": "unheard of"}')
    assert card.terms_of(variant_of(card, tmp_path)) == BOUND
