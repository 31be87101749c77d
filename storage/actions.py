"""Keep what was done: one record an action key, created by link, first writer wins.

A record says which object came out, what went into its key (so that the next run can say
what changed), and what it cost. ``latest/`` points from (scene, step, label) to the newest
key; it is derived from the records and only used for explanations.
"""

from __future__ import annotations

import dataclasses
import json
import uuid
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from storage import _os
from storage.digest import digest_bytes, digest_value, hexadecimal

FORMAT = 1


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
        """Return the record as JSON."""
        document = {"format": FORMAT, **dataclasses.asdict(self)}
        return json.dumps(document, sort_keys=True, ensure_ascii=False, indent=1).encode()

    @classmethod
    def from_bytes(cls, data: bytes) -> ActionRecord:
        """Read a record; ValueError if it is none of this format."""
        document = json.loads(data)
        if not isinstance(document, dict) or document.pop("format", None) != FORMAT:
            raise ValueError("no action record of a known format")
        outputs = {name: Output(**output) for name, output in document.pop("outputs").items()}
        try:
            return cls(outputs=outputs, **document)
        except TypeError as error:
            raise ValueError(f"no action record: {error}") from error

    def same_outputs(self, other: ActionRecord) -> bool:
        """Tell whether both records hold the same contents."""
        contents = {name: output.content for name, output in self.outputs.items()}
        return contents == {name: output.content for name, output in other.outputs.items()}


def action_path(store: Path, key: str) -> Path:
    """Return where the record of this key stands."""
    name = hexadecimal(key)
    return store / "actions" / name[:2] / f"{name[2:]}.json"


def read_action(store: Path, key: str) -> ActionRecord | None:
    """Return the record of a key; None if there is none, or none that can be read."""
    try:
        record = ActionRecord.from_bytes(action_path(store, key).read_bytes())
    except (FileNotFoundError, ValueError, KeyError):
        return None
    return record if record.key == key else None


def create_action(
    store: Path, record: ActionRecord, staged: Path, *, durable: bool
) -> ActionRecord:
    """Publish a record and return the one that counts: the first of its key.

    If another writer was first and found other contents, ours is kept under
    ``conflicts/`` as evidence that the step is not deterministic.
    """
    path = action_path(store, record.key)
    _os.ensure_folder(path.parent, durable=durable)
    draft = staged / f"action-{uuid.uuid4().hex}.json"
    _write(draft, record.to_bytes(), durable=durable)
    for _attempt in range(3):
        try:
            _os.active.link(draft, path)
        except FileExistsError:
            winner = read_action(store, record.key)
            if winner is None:
                delete_action(store, record.key)  # unreadable: no record at all
                continue
            if not winner.same_outputs(record):
                _keep_conflict(store, record, draft, durable=durable)
            return winner
        if durable:
            _os.active.fsync(path.parent)
        return record
    raise OSError(f"cannot create the action record {path}")


def _keep_conflict(store: Path, record: ActionRecord, draft: Path, *, durable: bool) -> None:
    name = hexadecimal(record.key)
    outcome = hexadecimal(digest_bytes(record.to_bytes()))[:16]
    place = store / "conflicts" / name[:2] / f"{name[2:]}-{outcome}.json"
    _os.ensure_folder(place.parent, durable=durable)
    try:
        _os.active.link(draft, place)
    except FileExistsError:
        return
    if durable:
        _os.active.fsync(place.parent)


def delete_action(store: Path, key: str) -> None:
    """Forget an action; its object is not touched."""
    try:
        _os.active.unlink(action_path(store, key))
    except FileNotFoundError:
        return


def all_actions(store: Path) -> Iterator[ActionRecord]:
    """Give every readable record, in no particular order."""
    for path in all_action_paths(store):
        try:
            yield ActionRecord.from_bytes(path.read_bytes())
        except (FileNotFoundError, ValueError, KeyError):
            continue


def all_action_paths(store: Path) -> Iterator[Path]:
    """Give the path of every record."""
    yield from (store / "actions").glob("??/*.json")


def latest_path(store: Path, scene: str, step: str, label: str) -> Path:
    """Return where the pointer to the newest action of a scene's step stands."""
    shelf = hexadecimal(digest_value(scene, domain="garden.scene/1"))[:24]
    name = hexadecimal(digest_value((step, label), domain="garden.latest/1"))[:24]
    return store / "latest" / shelf / f"{name}.json"


def point_to_latest(
    store: Path, staged: Path, *, scene: str, step: str, label: str, key: str
) -> None:
    """Remember ``key`` as the newest action of (scene, step, label)."""
    path = latest_path(store, scene, step, label)
    _os.ensure_folder(path.parent, durable=False)
    draft = staged / f"latest-{uuid.uuid4().hex}.json"
    document = {"key": key, "label": label, "scene": scene, "step": step}
    _os.active.write(draft, json.dumps(document, sort_keys=True).encode())
    _os.active.rename(draft, path)


def latest_key(store: Path, scene: str, step: str, label: str) -> str | None:
    """Return the key that ``point_to_latest`` remembered, if any."""
    return _pointer(latest_path(store, scene, step, label)).get("key")


def latest_of_scene(store: Path, scene: str) -> Iterator[tuple[str, str, str]]:
    """Give (step, label, key) of every step that ran for ``scene``."""
    for path in sorted(latest_path(store, scene, "", "").parent.glob("*.json")):
        pointer = _pointer(path)
        if pointer:
            yield pointer["step"], pointer["label"], pointer["key"]


def _pointer(path: Path) -> dict[str, str]:
    try:
        document = json.loads(path.read_bytes())
    except (OSError, ValueError):
        return {}
    return document if isinstance(document, dict) else {}


def _write(path: Path, data: bytes, *, durable: bool) -> None:
    _os.active.write(path, data)
    _os.active.chmod(path, 0o444)
    if durable:
        _os.active.fsync(path)
