"""Make a step's action key, and say in words what differs between two of them."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from storage.canonical import UNKEYED, is_array, plain_scalar
from storage.digest import digest_value
from storage.redact import redact, redacted
from tasks.step.code import Code
from tasks.step.files import file_changes, split_files
from tasks.step.ref import Why

_SHOWN = 60  # characters of a value in a sentence


@dataclass(frozen=True)
class KeyParts:
    """All that a result depends on. Not: paths, times, machines, scene and target names.

    ``inputs`` are content digests by argument, ``config`` the plain arguments.
    """

    step: str
    version: int
    code: Code
    inputs: dict[str, Any]
    config: dict[str, Any]
    backend: str
    weights: dict[str, str]
    seed: int

    @functools.cached_property
    def key(self) -> str:
        """The action key."""
        return digest_value(
            (
                self.step,
                self.version,
                self.code.digest,
                self.inputs,
                self.config,
                self.backend,
                self.weights,
                self.seed,
            ),
            domain="garden.action/1",
        )

    def to_json(self) -> dict[str, Any]:
        """Return what an action record keeps, so that a later run can say what changed.

        Secrets among the settings count in the key but are not kept.
        """
        return {
            "version": self.version,
            "inputs": _flat(self.inputs),
            "config": redacted(_flat(self.config)),
            "code": self.code.modules,
            "packages": self.code.packages,
            "backend": redact(self.backend),
            "weights": redacted(self.weights),
            "seed": self.seed,
        }


def without(arguments: Mapping[str, Any], skip: tuple[str, ...]) -> dict[str, Any]:
    """Return the arguments less those that ``skip`` names (``arg`` or ``arg.field``)."""
    kept = {name: value for name, value in arguments.items() if name not in skip}
    for dotted in skip:
        name, _, attribute = dotted.partition(".")
        if attribute and name in kept:
            kept[name] = _without_field(kept[name], attribute)
    return kept


def _without_field(value: Any, attribute: str) -> Any:
    if isinstance(value, dict):
        return {name: item for name, item in value.items() if name != attribute}
    names = [f.name for f in dataclasses.fields(value) if not f.metadata.get(UNKEYED)]
    if attribute not in names:
        raise ValueError(f"{type(value).__name__} has no field {attribute!r} to skip")
    return {name: getattr(value, name) for name in names if name != attribute}


def explain(parts: KeyParts, last: Mapping[str, Any] | None) -> Why:
    """Say why an action that is not in the store has to run.

    Args:
        parts: the action's key parts.
        last: the parts (``to_json``) of the last action of the same scene, step and label.
    """
    if last is None:
        return Why("new", "it has not run before")
    now = parts.to_json()
    changes: list[Why] = []
    if last.get("version") != now["version"]:
        changes.append(Why("version", f"step version {last.get('version')} -> {now['version']}"))
    changes += _mapping_changes("input", "input", last, now, "inputs", values=False)
    changes += _config_changes(last.get("config", {}), now["config"])
    for name in ("backend", "seed"):
        if last.get(name) != now[name]:
            changes.append(Why(name, f"{name} {last.get(name)} -> {now[name]}"))
    changes += _mapping_changes("weights", "weights", last, now, "weights", values=False)
    changes += _code_changes(last.get("code", {}), now["code"])
    changes += _mapping_changes("packages", "package", last, now, "packages", values=True)
    if not changes:
        return Why("evicted", "its result is no longer in the store")
    return Why(changes[0].code, "; ".join(change.sentence for change in changes[:4]))


def _config_changes(before: Mapping[str, Any], after: Mapping[str, Any]) -> list[Why]:
    """Return what changed in the user's files, by name, and then in the settings."""
    last, now = ({"config": split_files(leaves)[1]} for leaves in (before, after))
    return [
        *(Why("input", sentence) for sentence in file_changes(before, after)),
        *_mapping_changes("config", "", last, now, "config", values=True),
    ]


def _mapping_changes(
    code: str,
    word: str,
    last: Mapping[str, Any],
    now: Mapping[str, Any],
    part: str,
    *,
    values: bool,
) -> list[Why]:
    before, after = last.get(part, {}), now[part]
    found: list[Why] = []
    for name in sorted(before.keys() | after.keys()):
        if before.get(name, _ABSENT) == after.get(name, _ABSENT):
            continue
        what = f"{word} {name}".strip()
        if values:
            what += f" {_shown(before.get(name, _ABSENT))} -> {_shown(after.get(name, _ABSENT))}"
        else:
            what += " changed"
        found.append(Why(code, what))
    return found


def _code_changes(before: Mapping[str, str], after: Mapping[str, str]) -> list[Why]:
    names = [
        name for name in sorted(before.keys() | after.keys()) if before.get(name) != after.get(name)
    ]
    if not names:
        return []
    listed = ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
    return [Why("code", f"code changed ({listed})")]


_ABSENT = "nothing"


def _shown(value: Any) -> str:
    text = value if value is _ABSENT else repr(value)
    return text if len(text) <= _SHOWN else text[: _SHOWN - 3] + "..."


def _flat(value: Any, where: str = "") -> dict[str, Any]:
    """Return the plain leaves of a value by dotted path; long ones by their digest."""
    value = plain_scalar(value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        children = [
            (f.name, getattr(value, f.name))
            for f in dataclasses.fields(value)
            if not f.metadata.get(UNKEYED)
        ]
    elif isinstance(value, dict):
        children = list(value.items())
    elif isinstance(value, tuple | list) and any(_has_children(item) for item in value):
        children = [(str(index), item) for index, item in enumerate(value)]
    else:
        return {where: _leaf(value)}
    flat: dict[str, Any] = {}
    for name, child in children:
        flat |= _flat(child, f"{where}.{name}" if where else name)
    return flat


def _has_children(value: object) -> bool:
    return isinstance(value, dict | tuple | list) or dataclasses.is_dataclass(value)


def _leaf(value: Any) -> Any:
    if is_array(value) or isinstance(value, bytes) or (isinstance(value, str) and len(value) > 200):
        return digest_value(value, domain="garden.shown/1")
    if isinstance(value, tuple):
        return list(value)
    return value
