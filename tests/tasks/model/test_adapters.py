"""Every adapter says what its model is asked and answers, and answers can be checked by it."""

from __future__ import annotations

import dataclasses
import inspect

import pytest

from garden_models import foundation
from storage.codec.tree import field_hints
from tasks.model_worker.nouns import nouns_of


@pytest.mark.parametrize("name", foundation.ADAPTERS)
def test_an_adapter_names_its_nouns(name: str) -> None:
    request, answer = nouns_of(foundation.ADAPTERS[name])
    for noun in (request, answer):
        assert dataclasses.is_dataclass(noun)
        assert noun.SCHEMA.startswith("garden.")
        assert field_hints(noun)
    if hasattr(answer, "fits"):
        assert list(inspect.signature(answer.fits).parameters) == ["self", "request"]


@pytest.mark.parametrize("name", foundation.ADAPTERS)
def test_a_card_is_its_adapters(name: str) -> None:
    card = foundation.card(name)
    assert card.name == name
    assert card.weights


def test_an_adapter_without_its_nouns_is_a_mistake_of_ours() -> None:
    with pytest.raises(TypeError, match=r"must return a Callable\[\[Request\], Answer\]"):
        nouns_of("tests.tasks.model.unsaid")
