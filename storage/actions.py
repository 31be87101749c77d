"""Keep what was done: one record an action key, created at once, first writer wins.

A record says which object came out, what went into its key (so that the next run can say
what changed), and what it cost. ``latest/`` points from (scene, step, label) to the newest
key; it is derived from the records and only used for explanations.
"""

from __future__ import annotations

import dataclasses
import functools
import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from storage.digest import digest_bytes, digest_value, hexadecimal, is_digest

if TYPE_CHECKING:
    from storage.medium import Medium

FORMAT = 2
_UNSEALED = 1
"""The format of records that do not hold their own digest; they are read as they are."""

_SEAL, _END = b', "~digest": "', b'"}'
_DIGEST_LENGTH = 67


@dataclass(frozen=True)
class Output:
    """One result of an action."""

    object: str
    content: str
    kind: str
    bytes: int


@dataclass(frozen=True)
class ActionRecord:
    """One finished action. ``parts`` are the key's ingredients; ``seconds`` its cost.

    ``started`` is in Unix seconds. ``verdict`` is ``{"status", "reasons"}`` of the value.
    """

    key: str
    step: str
    scene: str
    label: str
    outputs: dict[str, Output]
    verdict: dict[str, Any]
    seconds: dict[str, float]
    peak_mb: float
    started: float
    parts: dict[str, Any]
    backend: str = ""
    host: str = ""
    run_id: str = ""
    attempt: int = 1
    why: dict[str, str] = field(default_factory=dict)

    def to_bytes(self) -> bytes:
        """Return the record as JSON, sealed by its own digest."""
        document = {"format": FORMAT, **dataclasses.asdict(self)}
        body = json.dumps(document, sort_keys=True, ensure_ascii=False).encode()
        return b"".join((body[:-1], _SEAL, digest_bytes(body).encode(), _END))

    @classmethod
    def from_bytes(cls, data: bytes) -> ActionRecord:
        """Read a record; ValueError if it is none of a known format, or was damaged."""
        document = _document(data)
        try:
            outputs = {name: Output(**output) for name, output in document.pop("outputs").items()}
            return cls(outputs=outputs, **document)
        except (AttributeError, KeyError, TypeError) as error:
            raise ValueError(f"no action record: {error}") from error

    def same_outputs(self, other: ActionRecord) -> bool:
        """Tell whether both records hold the same contents."""
        contents = {name: output.content for name, output in self.outputs.items()}
        return contents == {name: output.content for name, output in other.outputs.items()}


def _document(data: bytes) -> dict[str, Any]:
    """Return what a record's bytes say; ValueError if they are not those that were written."""
    end = len(data) - len(_END)
    start = end - _DIGEST_LENGTH
    sealed = data[start - len(_SEAL) : start] == _SEAL and data[end:] == _END
    if sealed:
        body = data[: start - len(_SEAL)] + b"}"
        if digest_bytes(body) != data[start:end].decode("ascii", "replace"):
            raise ValueError("the action record has changed since it was written")
        data = body
    document = json.loads(data)
    form = document.pop("format", None) if isinstance(document, dict) else None
    if form != (FORMAT if sealed else _UNSEALED):
        raise ValueError("no action record of a known format")
    return dict(document)


def action_name(key: str) -> str:
    """Return the name of the document that holds the record of this key."""
    name = hexadecimal(key)
    return f"actions/{name[:2]}/{name[2:]}.json"


def named_key(name: str) -> str:
    """Return the key that the name of an action's document stands for; maybe no digest."""
    return "b3:" + name.removeprefix("actions/").removesuffix(".json").replace("/", "")


def is_action_name(name: str) -> bool:
    """Tell whether a document is where the record of some key would be."""
    key = named_key(name)
    return is_digest(key) and action_name(key) == name


def read_action(medium: Medium, key: str) -> ActionRecord | None:
    """Return the record of a key; None if there is none, or none that can be read."""
    data = medium.read(action_name(key))
    try:
        record = None if data is None else ActionRecord.from_bytes(data)
    except ValueError:
        return None
    return record if record is not None and record.key == key else None


def create_action(medium: Medium, record: ActionRecord) -> ActionRecord:
    """Publish a record and return the one that counts: the first of its key.

    If another writer was first and found other contents, ours is kept under
    ``conflicts/`` as evidence that the step is not deterministic.
    """
    name = action_name(record.key)
    for _attempt in range(3):
        if medium.create(name, record.to_bytes()):
            return record
        winner = read_action(medium, record.key)
        if winner is None:
            medium.delete(name)  # unreadable: no record at all
            continue
        if not winner.same_outputs(record):
            _keep_conflict(medium, record)
        return winner
    raise OSError(f"cannot create the action record {name}")


def _keep_conflict(medium: Medium, record: ActionRecord) -> None:
    name = hexadecimal(record.key)
    outcome = hexadecimal(digest_bytes(record.to_bytes()))[:16]
    medium.create(f"conflicts/{name[:2]}/{name[2:]}-{outcome}.json", record.to_bytes())


def all_conflicts(medium: Medium) -> Iterator[ActionRecord]:
    """Give every readable record that came second and differed."""
    yield from _records(medium, "conflicts/")


def all_actions(medium: Medium) -> Iterator[ActionRecord]:
    """Give every readable record, in no particular order."""
    yield from _records(medium, "actions/")


def _records(medium: Medium, prefix: str) -> Iterator[ActionRecord]:
    for name in medium.names(prefix):
        data = medium.read(name)
        try:
            if data is not None:
                yield ActionRecord.from_bytes(data)
        except ValueError:
            continue


def latest_name(scene: str, step: str, label: str) -> str:
    """Return the name of the pointer to the newest action of a scene's step."""
    name = hexadecimal(digest_value((step, label), domain="garden.latest/1"))[:24]
    return f"{_latest_shelf(scene)}{name}.json"


@functools.lru_cache(maxsize=64)
def _latest_shelf(scene: str) -> str:
    return f"latest/{hexadecimal(digest_value(scene, domain='garden.scene/1'))[:24]}/"


def point_to_latest(medium: Medium, *, scene: str, step: str, label: str, key: str) -> None:
    """Remember ``key`` as the newest action of (scene, step, label)."""
    document = {"key": key, "label": label, "scene": scene, "step": step}
    medium.replace(latest_name(scene, step, label), json.dumps(document, sort_keys=True).encode())


def latest_key(medium: Medium, scene: str, step: str, label: str) -> str | None:
    """Return the key that ``point_to_latest`` remembered, if any."""
    return _pointer(medium, latest_name(scene, step, label)).get("key")


def latest_of_scene(medium: Medium, scene: str) -> Iterator[tuple[str, str, str]]:
    """Give (step, label, key) of every step that ran for ``scene``."""
    for name in medium.names(_latest_shelf(scene)):
        pointer = _pointer(medium, name)
        if pointer:
            yield pointer["step"], pointer["label"], pointer["key"]


def pointed_action(medium: Medium, pointer: str) -> str | None:
    """Return the name of the action's document to which a pointer in ``latest/`` points."""
    key = _pointer(medium, pointer).get("key")
    return action_name(key) if isinstance(key, str) and is_digest(key) else None


def latest_record(medium: Medium, scene: str, step: str, label: str) -> ActionRecord | None:
    """Return the newest action of a scene's step, also if it has been forgotten since."""
    pointer = _pointer(medium, latest_name(scene, step, label))
    return _pointed_record(medium, pointer)


def remembered(medium: Medium, scene: str) -> Iterator[ActionRecord]:
    """Give the actions of a scene's steps that have been forgotten but are still explained."""
    for name in medium.names(_latest_shelf(scene)):
        pointer = _pointer(medium, name)
        record = _pointed_record(medium, pointer)
        if record is not None and "record" in pointer and read_action(medium, record.key) is None:
            yield record


def keep_for_explanations(medium: Medium, record: ActionRecord) -> None:
    """Put a record that is about to be forgotten where a later run can say what changed."""
    name = latest_name(record.scene, record.step, record.label)
    pointer = _pointer(medium, name)
    if pointer.get("key") == record.key and "record" not in pointer:
        document = {**pointer, "record": record.to_bytes().decode()}
        medium.replace(name, json.dumps(document, sort_keys=True).encode())


def _pointed_record(medium: Medium, pointer: dict[str, Any]) -> ActionRecord | None:
    if "key" not in pointer:
        return None
    try:
        record = read_action(medium, pointer["key"])
        if record is None and "record" in pointer:
            return ActionRecord.from_bytes(pointer["record"].encode())
    except (ValueError, AttributeError):
        return None
    return record


def _pointer(medium: Medium, name: str) -> dict[str, Any]:
    try:
        document = json.loads(medium.read(name) or b"{}")
    except (OSError, ValueError):
        return {}
    return document if isinstance(document, dict) else {}
