"""Every noun of ``garden_models.scene`` can be published and comes back as it was."""

from __future__ import annotations

import dataclasses
import types
import typing
from typing import Any

import numpy as np
import pytest

from garden_models import scene
from storage import Store
from tests.storage.samples import same

NOUNS = [
    value
    for value in vars(scene).values()
    if isinstance(value, type) and dataclasses.is_dataclass(value) and hasattr(value, "SCHEMA")
]


def build(hint: Any, size: int) -> Any:
    """Return some value of a type hint; tuples have ``size`` items, free axes too."""
    if hasattr(hint, "dim_str"):
        shape = [int(d) if d.isdigit() else size for d in hint.dim_str.split()]
        return np.arange(np.prod(shape)).astype(numpy_type(hint.dtypes)).reshape(shape)
    if dataclasses.is_dataclass(hint):
        hints = typing.get_type_hints(hint)
        names = [f.name for f in dataclasses.fields(hint)]
        return hint(**{name: build(hints[name], size) for name in names})  # type: ignore[operator]
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is typing.Literal:
        return arguments[-1]
    if origin in (typing.Union, types.UnionType):
        chosen = [a for a in arguments if a is not type(None)]
        return build(chosen[0], size) if size else None
    if origin is tuple and arguments[-1] is Ellipsis:
        return tuple(build(arguments[0], size + i) for i in range(size))
    if origin is tuple:
        return tuple(build(a, size) for a in arguments)
    if origin is dict:
        return {f"key {i}": build(arguments[1], size) for i in range(size)}
    return {str: "text", int: 7, float: 0.1, bool: True}[hint]


def numpy_type(names: Any) -> str:
    if "bool" in names:
        return "bool"
    return next(n for n in ("uint8", "float32", "int64") if n in names)


@pytest.mark.parametrize("noun", NOUNS, ids=lambda noun: noun.__name__)
@pytest.mark.parametrize("size", [0, 2])
def test_every_noun_comes_back(store: Store, noun: Any, size: int) -> None:
    value = build(noun, size)
    assert same(store.read(store.publish(value).object, noun), value)
