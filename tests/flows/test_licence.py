"""--licence permissive refuses, by name and before work, what forbids commercial use."""

from __future__ import annotations

import dataclasses
import sys
from types import ModuleType

import pytest

from flows.licence import check_licence, models_of
from flows.package.licences import licences_document
from flows.preset import Preset
from flows.wrong_use import WrongUse
from garden_models.foundation import ADAPTERS
from garden_models.foundation.model_card import ModelCard, Terms

FREE = Terms("Apache-2.0", "Apache-2.0", commercial=True)
BOUND = Terms("Apache-2.0", "CC BY-NC 4.0", commercial=False)


@pytest.fixture
def bound_model(monkeypatch: pytest.MonkeyPatch) -> str:
    """Return the name of a model whose giant variant is for research only."""
    module = ModuleType("a_model")
    module.CARD = ModelCard(  # type: ignore[attr-defined]
        name="a_model",
        title="A Model",
        source="https://example.org/a-model",
        stage="segment",
        terms=BOUND,
        weights=(),
        imports=(),
        variant_key="model_name",
        variants={"small": FREE, "giant": BOUND},
    )
    monkeypatch.setitem(sys.modules, "a_model", module)
    monkeypatch.setitem(ADAPTERS, "a_model", "a_model")
    return "a_model"


def _preset(model: str) -> Preset:
    gravity = dataclasses.replace(Preset().gravity, methods=("planes", model))
    return dataclasses.replace(Preset(), gravity=gravity)


def test_the_embedded_preset_names_no_model() -> None:
    assert models_of(Preset()) == ()
    check_licence(Preset(), "permissive")


def test_a_bound_model_is_refused_by_name(bound_model: str) -> None:
    with pytest.raises(WrongUse, match=r"A Model.*CC BY-NC 4\.0.*choose another"):
        check_licence(_preset(bound_model), "permissive")
    check_licence(_preset(bound_model), "any")


def test_a_free_variant_passes(bound_model: str) -> None:
    check_licence(_preset(bound_model), "permissive", lambda name: "small")
    with pytest.raises(WrongUse):
        check_licence(_preset(bound_model), "permissive", lambda name: "giant")


def test_a_package_names_the_models_that_made_it(bound_model: str) -> None:
    document = licences_document(["embedded", f"{bound_model}/giant", bound_model + "/small"])
    assert [m["name"] for m in document["models"]] == ["a_model/giant", "a_model/small"]
    assert [m["commercial_use"] for m in document["models"]] == [False, True]
    assert document["commercial_use"] is False
    assert licences_document(["embedded"])["commercial_use"] is True


def test_a_model_that_was_asked_over_a_network_is_named() -> None:
    (service,) = licences_document(services=["gemini-3-flash"])["services"]
    assert (service["name"], service["used_by"]) == ("gemini-3-flash", "targets")
    assert licences_document()["services"] == []
