"""Refuse models whose code or weights forbid commercial use (``--licence permissive``)."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from typing import Any, Literal, get_args

from flows.preset import Preset
from flows.wrong_use import WrongUse
from garden_models.foundation import ADAPTERS, card

Licence = Literal["any", "permissive"]
LICENCES: tuple[Licence, ...] = get_args(Licence)


def models_of(preset: Preset) -> tuple[str, ...]:
    """Return the models that a preset's options name, in the order of its steps."""
    return models_in(preset)


def models_in(options: Any) -> tuple[str, ...]:
    """Return the models that any options name, in their order."""
    return tuple(dict.fromkeys(name for name in _texts(options) if name in ADAPTERS))


def check_licence(
    preset: Preset, licence: Licence, variant: Callable[[str], str | None] = lambda name: None
) -> None:
    """Raise WrongUse if the preset names a model that ``licence`` refuses.

    ``variant`` tells which variant of a model this machine has; a model whose variant is not
    known counts as its strictest one.
    """
    if licence == "any":
        return
    refused = []
    for name in models_of(preset):
        about = card(name)
        terms = about.terms_of(variant(name))
        if not terms.commercial:
            refused.append(f"{about.title} ({name}: code {terms.code}, weights {terms.weights})")
    if refused:
        raise WrongUse(
            f"--licence permissive refuses {'; '.join(refused)}: choose another model or variant "
            "for that step (garden doctor lists them), or leave out --licence permissive"
        )


def _texts(value: Any) -> Iterator[str]:
    """Yield the texts in a configuration."""
    if isinstance(value, str):
        yield value
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            yield from _texts(getattr(value, field.name))
    elif isinstance(value, list | tuple):
        for item in value:
            yield from _texts(item)
