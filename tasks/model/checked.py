"""Refuse what a model answers if it is not what its noun says, or does not fit the question."""

from __future__ import annotations

import dataclasses
import typing
from collections.abc import Iterator
from typing import Any

import jaxtyping
import numpy as np

from garden_models.foundation.failure import ModelFailed
from storage.canonical import plain_scalar
from storage.codec.tree import field_hints


def check_answer(name: str, request: Any, answer: Any, expected: type) -> None:
    """Check types, shapes and that all numbers are finite.

    A dimension that request and answer name alike (``k h w``) has one size; an answer may have
    ``fits(request)``, which returns what else is wrong with it, or nothing.

    Raises ModelFailed, which names the model and what is wrong.
    """
    if not isinstance(answer, expected):
        said = f"a {type(answer).__name__}"
        raise ModelFailed(f"{name} answered {said} where a {expected.__name__} is due")
    with jaxtyping.jaxtyped("context"):
        _bind(request)
        found = list(_wrong_fields(answer, expected.__name__))
    wrong = found[0] if found else ""
    fits = getattr(answer, "fits", None)
    if not wrong and fits is not None:
        wrong = fits(request) or ""
    if wrong:
        raise ModelFailed(f"{name} gave an answer that cannot be: {wrong}")


def _bind(request: Any) -> None:
    """Take the sizes of a request's own arrays for the names in their annotations."""
    for f in dataclasses.fields(request):
        value = getattr(request, f.name)
        if isinstance(value, np.ndarray):
            for hint in _array_hints(field_hints(type(request))[f.name]):
                isinstance(value, hint)


def _wrong_fields(noun: Any, where: str) -> Iterator[str]:
    hints = field_hints(type(noun))
    for f in dataclasses.fields(noun):
        yield from _wrong(getattr(noun, f.name), hints[f.name], f"{where}.{f.name}")


def _wrong(value: Any, hint: Any, where: str) -> Iterator[str]:
    value = plain_scalar(value)
    if isinstance(value, np.ndarray):
        yield from _wrong_array(value, hint, where)
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        with jaxtyping.jaxtyped("context"):
            yield from _wrong_fields(value, where)
    elif isinstance(value, tuple | list):
        for index, item in enumerate(value):
            with jaxtyping.jaxtyped("context"):
                yield from _wrong(item, hint, f"{where}[{index}]")
    elif isinstance(value, dict):
        for key, item in value.items():
            yield from _wrong(item, hint, f"{where}[{key!r}]")
    elif isinstance(value, float) and not np.isfinite(value):
        yield f"{where} is {value}"
    elif not _is_plain(value, hint):
        yield f"{where} is a {type(value).__name__}"


def _wrong_array(value: np.ndarray, hint: Any, where: str) -> Iterator[str]:
    hints = list(_array_hints(hint))
    if hints and not any(isinstance(value, found) for found in hints):
        due = " or ".join(str(found.__name__) for found in hints)
        yield f"{where} is {value.dtype} {list(value.shape)}, not {due}"
    elif value.dtype.kind == "f" and not np.isfinite(value).all():
        bad = int((~np.isfinite(value)).sum())
        yield f"{bad} of {value.size} numbers of {where} are not finite"


def _array_hints(hint: Any) -> Iterator[Any]:
    """Give the array types that a hint such as ``tuple[Float[ndarray, "n"], ...] | None`` has."""
    for leaf in _leaves(hint):
        if isinstance(leaf, type) and issubclass(leaf, jaxtyping.AbstractArray):
            yield leaf


def _is_plain(value: Any, hint: Any) -> bool:
    """Tell whether something that is no array may stand where the hint stands."""
    types = set(_leaves(hint))
    if value is None:
        return type(None) in types
    if not isinstance(value, str | bytes | bool | int | float):
        return False
    return bool(types & {str, bytes, bool, int, float}) or not any(map(_is_array_type, types))


def _leaves(hint: Any) -> Iterator[Any]:
    """Give the types that a hint is made of."""
    if _is_array_type(hint) or not typing.get_args(hint):
        yield hint
        return
    for argument in typing.get_args(hint):
        yield from _leaves(argument)


def _is_array_type(hint: Any) -> bool:
    return isinstance(hint, type) and issubclass(hint, jaxtyping.AbstractArray | np.ndarray)
