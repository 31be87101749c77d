"""Take a value apart into a JSON tree and its leaves, and put it together again.

The tree says what every node is (``{"$tuple": [...]}``, ``{"$type": "View", ...}``), so
that reading needs the classes only to build them; storage itself knows no noun. Fields
that do not count (``storage.canonical.UNKEYED``) stand apart from the others.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import sys
import typing
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from storage.canonical import UNKEYED, is_array, plain_scalar
from storage.errors import SchemaMismatch, Unstorable

Json = Any
LONG_TEXT = 4096  # characters; longer texts are members of their own


@dataclass
class Encoded:
    """A value taken apart: ``leaves`` are keyed by their path in the value."""

    tree: Json = None
    leaves: dict[str, Any] = field(default_factory=dict)


def encode(value: object) -> Encoded:
    """Take ``value`` apart.

    Raises:
        Unstorable: something in it has no stored form; the message says where.
    """
    encoded = Encoded()
    encoded.tree = _encode(value, "", encoded.leaves)
    return encoded


def counted(tree: Json) -> tuple[Json, frozenset[str]]:
    """Return a tree without the fields that do not count, and the leaves that it still has."""
    leaves: set[str] = set()
    return _counted(tree, leaves), frozenset(leaves)


def _counted(tree: Json, leaves: set[str]) -> Json:
    if isinstance(tree, list):
        return [_counted(item, leaves) for item in tree]
    if not isinstance(tree, dict):
        return tree
    if "$leaf" in tree:
        leaves.add(tree["$leaf"])
    for part in ("$dict", "fields"):
        if part in tree:
            children = {name: _counted(child, leaves) for name, child in tree[part].items()}
            rest = {name: tree[name] for name in tree.keys() - {part, UNKEYED}}
            return {**rest, part: children}
    if "$tuple" in tree:
        return {"$tuple": [_counted(item, leaves) for item in tree["$tuple"]]}
    return tree


def kind_of(value: object) -> tuple[str, str]:
    """Return the kind (class name) and schema (``SCHEMA`` of the class, or its name)."""
    if dataclasses.is_dataclass(value):
        cls = value if isinstance(value, type) else type(value)
        return cls.__name__, str(getattr(cls, "SCHEMA", cls.__name__))
    name = type(value).__name__ if not isinstance(value, type) else value.__name__
    return name, name


def _encode(value: object, where: str, leaves: dict[str, Any]) -> Json:
    value = plain_scalar(value)
    if value is None or isinstance(value, bool | int):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else {"$float": repr(value)}
    if isinstance(value, str) and len(value) <= LONG_TEXT:
        return value
    if isinstance(value, str | bytes) or is_array(value) or _is_table(value):
        leaves[where] = value
        return {"$leaf": where}
    if isinstance(value, tuple):
        return {"$tuple": [_encode(v, _join(where, i), leaves) for i, v in enumerate(value)]}
    if isinstance(value, list):
        return [_encode(v, _join(where, i), leaves) for i, v in enumerate(value)]
    if isinstance(value, dict):
        return {
            "$dict": {_key(k, where): _encode(value[k], _join(where, k), leaves) for k in value}
        }
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        node: dict[str, Json] = {"$type": type(value).__name__, "fields": {}}
        for f in dataclasses.fields(value):
            part = UNKEYED if f.metadata.get(UNKEYED) else "fields"
            stored = _encode(getattr(value, f.name), _join(where, f.name), leaves)
            node.setdefault(part, {})[f.name] = stored
        return node
    raise Unstorable(
        f"{where or 'the value'} is a {type(value).__name__}: store dataclasses of numpy"
        " arrays, numbers, str, bytes, None, tuples, lists, dicts and pyarrow tables"
    )


def _join(where: str, step: object) -> str:
    escaped = str(step).replace("%", "%25").replace("/", "%2F")
    return f"{where}/{escaped}" if where else escaped


def _key(key: object, where: str) -> str:
    if not isinstance(key, str):
        raise Unstorable(f"{where or 'the value'} has the key {key!r}: dict keys must be str")
    return key


def _is_table(value: object) -> bool:
    pyarrow = sys.modules.get("pyarrow")
    return pyarrow is not None and isinstance(value, pyarrow.Table)


def decode(tree: Json, expected: object, leaf: Callable[[str], Any]) -> Any:
    """Put a value together; ``leaf`` gives the leaf of a path.

    Args:
        tree: from ``encode``.
        expected: the class, or type hint, that the value should have; its dataclasses
            (also those in its fields' hints) are the ones that may be built.
        leaf: reads the leaf at a path of the value.

    Raises:
        SchemaMismatch: the tree does not fit the classes.
    """
    if isinstance(tree, list):
        return [decode(item, expected, leaf) for item in tree]
    if not isinstance(tree, dict):
        return tree
    if "$leaf" in tree:
        return leaf(tree["$leaf"])
    if "$tuple" in tree:
        return tuple(decode(item, expected, leaf) for item in tree["$tuple"])
    if "$dict" in tree:
        return {key: decode(item, expected, leaf) for key, item in tree["$dict"].items()}
    if "$float" in tree:
        return float(tree["$float"])
    return _build(tree, expected, leaf)


def field_tree(tree: Json, name: str) -> Json:
    """Return the subtree of one field of a dataclass' tree."""
    for part in ("fields", UNKEYED):
        if isinstance(tree, dict) and name in tree.get(part, {}):
            return tree[part][name]
    raise SchemaMismatch(f"the stored value has no field {name!r}")


def field_hints(cls: type) -> dict[str, object]:
    """Return the resolved type hints of a dataclass' fields."""
    return _hints(cls)


@functools.cache
def _hints(cls: type) -> dict[str, object]:
    return typing.get_type_hints(cls)


def _build(tree: dict[str, Json], expected: object, leaf: Callable[[str], Any]) -> Any:
    name = tree.get("$type")
    candidates = _dataclasses_in(expected)
    if name not in candidates:
        raise SchemaMismatch(
            f"the stored value is a {name}, expected {' or '.join(candidates) or expected}"
        )
    cls = candidates[name]
    stored: dict[str, Json] = tree["fields"] | tree.get(UNKEYED, {})
    known = {f.name: f for f in dataclasses.fields(cls)}
    if unknown := sorted(stored.keys() - known.keys()):
        raise SchemaMismatch(f"the stored {name} has the field {unknown[0]!r}, which {cls} lacks")
    hints = _hints(cls)
    values = {key: decode(subtree, hints[key], leaf) for key, subtree in stored.items()}
    for key, spec in known.items():
        optional = (
            spec.default is not dataclasses.MISSING
            or spec.default_factory is not dataclasses.MISSING
        )
        if key not in values and not optional:
            raise SchemaMismatch(f"the stored {name} lacks the field {key!r}")
    return cls(**values)


def _dataclasses_in(hint: object) -> dict[str, type]:
    """Return the dataclasses that a hint such as ``tuple[View, ...] | None`` mentions."""
    if isinstance(hint, type) and dataclasses.is_dataclass(hint):
        return {hint.__name__: hint}
    found: dict[str, type] = {}
    for argument in typing.get_args(hint):
        found.update(_dataclasses_in(argument))
    return found
