"""Tell from an adapter what its model is asked and answers."""

from __future__ import annotations

import typing
from importlib import import_module


def nouns_of(module: str) -> tuple[type, type]:
    """Return the classes of an adapter's request and answer, as its ``load`` is annotated.

    Raises TypeError for an adapter whose ``load`` does not say ``Callable[[Request], Answer]``.
    """
    hint = typing.get_type_hints(import_module(module).load).get("return")
    arguments = typing.get_args(hint)
    if len(arguments) == 2 and isinstance(arguments[0], list) and len(arguments[0]) == 1:
        request, answer = arguments[0][0], arguments[1]
        if isinstance(request, type) and isinstance(answer, type):
            return request, answer
    raise TypeError(f"{module}.load must return a Callable[[Request], Answer], not {hint}")
