"""Know every action of a store by what a collector asks of it, and keep that up to date."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass

from storage.actions import ActionRecord
from storage.forget import use_name
from storage.medium import Medium


@dataclass(frozen=True)
class Entry:
    """An action. ``objects`` are its outputs' bytes by digest, ``used`` is in Unix seconds."""

    name: str
    key: str
    scene: str
    step: str
    label: str
    started: float
    objects: dict[str, int]
    contents: tuple[str, ...]
    used: float


class Ledger:
    """The actions of a store as of the last ``refresh``, which reads only what is new."""

    def __init__(self, medium: Medium) -> None:
        self._medium = medium
        self._written: dict[str, float] = {}
        self._known: dict[str, Entry] = {}
        self._live: dict[str, int] = {}
        self.refresh()

    def refresh(self) -> None:
        """Take notice of what has changed."""
        written = dict(self._medium.times("actions/"))
        used = dict(self._medium.times("uses/"))
        changed = {name for name, when in written.items() if self._written.get(name) != when}
        for name in self._written.keys() - written.keys():
            self._known.pop(name, None)
        for name in changed:
            self._known.pop(name, None)
            entry = self._read(name)
            if entry is not None:
                self._known[name] = entry
        self._written = written
        for name, entry in self._known.items():
            last = max(written[name], used.get(use_name(entry.key), 0.0))
            if last != entry.used:
                self._known[name] = dataclasses.replace(entry, used=last)
        self._live = {d: size for entry in self for d, size in entry.objects.items()}

    def __iter__(self) -> Iterator[Entry]:
        return iter(list(self._known.values()))

    def gives(self, digest: str) -> bool:
        """Tell whether some action gave an object."""
        return digest in self._live

    def live_objects(self) -> dict[str, int]:
        """Return the bytes of every object that some action gave, by digest."""
        return dict(self._live)

    def record(self, entry: Entry) -> ActionRecord | None:
        """Return the whole record of an entry, None if it is gone."""
        data = self._medium.read(entry.name)
        with suppress(ValueError):
            return None if data is None else ActionRecord.from_bytes(data)
        return None

    def _read(self, name: str) -> Entry | None:
        data = self._medium.read(name)
        try:
            return None if data is None else _entry(name, json.loads(data))
        except (ValueError, KeyError, TypeError, AttributeError):
            return None


def _entry(name: str, document: dict) -> Entry:
    outputs = document["outputs"].values()
    return Entry(
        name=name,
        key=document["key"],
        scene=document["scene"],
        step=document["step"],
        label=document["label"],
        started=float(document["started"]),
        objects={output["object"]: int(output["bytes"]) for output in outputs},
        contents=tuple(output["content"] for output in outputs),
        used=0.0,
    )
