"""Bind the arguments of a step: which are references, which are plain, what they are called."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

from storage import CorruptArtifact, MissingArtifact
from tasks.step.ref import Ref, StepFailed
from tasks.step.run import RunContext


@dataclass(frozen=True)
class Arguments:
    """The arguments of one call, by parameter: references and plain values apart.

    A value in ``refs`` is a Ref, or a tuple in which at least one item is a Ref.
    """

    refs: dict[str, Any]
    plain: dict[str, Any]

    @property
    def pending(self) -> list[str]:
        """Names of the arguments that are not known yet."""
        return [name for name, value in self.refs.items() if any(r.pending for r in each(value))]

    def contents(self) -> dict[str, Any]:
        """Return the content digests of the references, as they enter the key."""
        return {name: _content(value) for name, value in self.refs.items()}


def each(value: Any) -> list[Ref]:
    """Return the references in an argument."""
    if isinstance(value, Ref):
        return [value]
    if isinstance(value, tuple):
        return [ref for item in value for ref in each(item)]
    return []


def _content(value: Any) -> Any:
    if isinstance(value, tuple):
        return tuple(_content(item) for item in value)
    if isinstance(value, Ref):
        return value.content
    return value


def futures_in(values: Mapping[str, Any]) -> list[Future[Ref]]:
    """Return the futures among the arguments, also inside tuples and lists."""
    found: list[Future[Ref]] = []
    for value in values.values():
        items = value if isinstance(value, tuple | list) else (value,)
        found += [item for item in items if isinstance(item, Future)]
    return found


def resolve(value: Any) -> Any:
    """Replace finished futures by their results; lists become tuples."""
    if isinstance(value, Future):
        return value.result()
    if isinstance(value, tuple | list) and any(isinstance(v, Future | Ref) for v in value):
        return tuple(resolve(item) for item in value)
    return value


def split(bound: Mapping[str, Any], publish: Callable[[object], Ref]) -> Arguments:
    """Tell references from plain values; a noun given as a value is published first.

    A noun is a dataclass with a ``SCHEMA``; only small ones may be plain.
    """
    refs: dict[str, Any] = {}
    plain: dict[str, Any] = {}
    for name, value in bound.items():
        if each(value):
            refs[name] = value
        elif _is_noun(value):
            refs[name] = publish(value)
        elif isinstance(value, tuple) and value and all(_is_noun(item) for item in value):
            refs[name] = tuple(publish(item) for item in value)
        else:
            plain[name] = value
    return Arguments(refs, plain)


def _is_noun(value: object) -> bool:
    return dataclasses.is_dataclass(value) and hasattr(type(value), "SCHEMA")


def label_of(arguments: Mapping[str, Any]) -> str:
    """Return the target that a call is about: of a Target, else of a single reference."""
    for value in arguments.values():
        if dataclasses.is_dataclass(value) and not isinstance(value, Ref):
            names = {field.name for field in dataclasses.fields(value)}
            if {"name", "photo"} <= names:
                return str(value.name)  # type: ignore[union-attr]
    for value in arguments.values():
        if isinstance(value, Ref) and value.label:
            return value.label
    return ""


def load_inputs(
    context: RunContext, arguments: Arguments, hints: Mapping[str, Any]
) -> dict[str, Any]:
    """Load the values behind the references of a call."""
    return {
        name: _load_argument(context, value, hints.get(name, object))
        for name, value in arguments.refs.items()
    }


def _load_argument(context: RunContext, value: Any, hint: Any) -> Any:
    if isinstance(value, tuple):
        return tuple(_load_argument(context, item, hint) for item in value)
    if isinstance(value, Ref):
        return load_ref(context, value, hint)
    return value


def load_ref(context: RunContext, ref: Ref, hint: Any, fields: tuple[str, ...] = ()) -> Any:
    """Read a value; if it was damaged, make it again with the step that made it in this run.

    Raises:
        CorruptArtifact, MissingArtifact: it is damaged or gone and cannot be made again here.
        StepFailed: making it again gave something else.
    """
    try:
        return _read(context, ref.object, hint, fields)
    except (CorruptArtifact, MissingArtifact) as error:
        lost = "corrupt" if isinstance(error, CorruptArtifact) else "evicted"
        if lost == "corrupt":
            context.store.discard(ref.object)
        again = context.producers.get(ref.object)
        if again is None:
            raise
    fresh = again(lost)
    if fresh.content != ref.content:
        raise StepFailed(
            ref.step,
            ref.label,
            "its damaged result was made again and came out different: start the run again",
            kind="CorruptArtifact",
        )
    return _read(context, fresh.object, hint, fields)


def _read(context: RunContext, digest: str, hint: Any, fields: tuple[str, ...]) -> Any:
    if fields:
        return context.store.read_fields(digest, hint, fields)
    return context.store.read_as(digest, hint)


def bind(
    signature: inspect.Signature, args: tuple[Any, ...], kwargs: dict[str, Any]
) -> dict[str, Any]:
    """Return the call's arguments by parameter, defaults applied, ``progress`` left out."""
    bound = signature.bind_partial(*args, **kwargs)
    bound.apply_defaults()
    values = {name: value for name, value in bound.arguments.items() if name != "progress"}
    missing = [
        name
        for name, parameter in signature.parameters.items()
        if name not in values and name != "progress" and parameter.default is parameter.empty
    ]
    if missing:
        raise TypeError(f"missing argument {missing[0]!r}")
    return values
