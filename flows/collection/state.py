"""Keep ``OUT/collection.json``: what came of every scene, also while the batch runs.

The file (schema ``garden.collection/1``, described in docs/collection.md) is always whole: it
is written beside and renamed. Whoever reads it can tell a batch that runs from one that
was killed by its owner.
"""

from __future__ import annotations

import contextlib
import dataclasses
import fcntl
import json
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from flows.collection.row import ENDED, SceneRow
from flows.wrong_use import WrongUse
from storage.formats.package import PackageError
from storage.owner import Owner

SCHEMA = "garden.collection/1"
STATE, FAILED, PAGE = "collection.json", "failed.json", "collection.html"
_EVERY_S = 0.5

Phase = Literal["running", "finished", "stopped", "stopped (killed)"]


@dataclass
class CollectionState:
    """A batch: who runs it, since when, and its scenes' rows in the collection's order."""

    name: str
    source: str
    store: str
    out: Path
    rows: dict[str, SceneRow]
    owner: Owner | None = None
    phase: Phase = "running"
    scenes_at_once: int = 1
    started: float = field(default_factory=time.time)
    updated: float = 0.0
    remarks: list[str] = field(default_factory=list)
    models: dict[str, dict[str, Any]] = field(default_factory=dict)
    """What each model cost so far (``tasks.model.tally.Cost``)."""

    before: dict[str, SceneRow] = field(default_factory=dict)
    """What the last batch left of these scenes; it holds until they are looked at again."""

    _written: float = 0.0

    def save(self, *, now: bool = True) -> None:
        """Write the file; with ``now=False`` only if the last time is half a second ago.

        Raises PackageError if it cannot be written.
        """
        if not now and time.monotonic() - self._written < _EVERY_S:
            return
        self._written, self.updated = time.monotonic(), time.time()
        write_beside(self.out / STATE, _dump(self.to_json()))

    def save_failed(self) -> None:
        """Write ``failed.json``: the scenes that failed, and why.

        A scene that failed the last time and has not ended since is still one of them, so
        that a rerun which is stopped forgets none.
        """
        document = {
            "schema": "garden.failed/1",
            "collection": self.name,
            "source": self.source,
            "scenes": [{"name": row.name, "reasons": row.reasons} for row in self._failed()],
        }
        write_beside(self.out / FAILED, _dump(document))

    def _failed(self) -> list[SceneRow]:
        last = {
            name: self.before.get(name, row) if row.status not in ENDED else row
            for name, row in self.rows.items()
        }
        return [row for row in last.values() if row.status == "failed"]

    def restore_waiting(self) -> None:
        """Give the scenes that were not reached the rows that they had before."""
        for name, row in self.rows.items():
            if row.status == "waiting" and name in self.before:
                self.rows[name] = self.before[name]

    def to_json(self) -> dict[str, Any]:
        """Return the file's document."""
        return {
            "schema": SCHEMA,
            "name": self.name,
            "source": self.source,
            "store": self.store,
            "phase": self.phase,
            "owner": dataclasses.asdict(self.owner) if self.owner else None,
            "scenes_at_once": self.scenes_at_once,
            "started": self.started,
            "updated": self.updated,
            "remarks": self.remarks,
            "models": self.models,
            "scenes": [row.to_json() for row in self.rows.values()],
        }


def read_state(out: Path) -> CollectionState | None:
    """Return the state in a folder, None if there is none; one whose owner died says so.

    Raises WrongUse for a file that is something else.
    """
    path = out / STATE
    try:
        document = json.loads(path.read_bytes())
    except FileNotFoundError:
        return None
    except ValueError as error:
        raise WrongUse(f"{path} cannot be read ({error}): remove it") from error
    if not isinstance(document, dict) or document.get("schema") != SCHEMA:
        raise WrongUse(f"{path} is no {SCHEMA}: choose another --out, or remove it")
    rows = [SceneRow.from_json(row) for row in document["scenes"]]
    owner = Owner(**document["owner"]) if document["owner"] else None
    state = CollectionState(
        name=document["name"],
        source=document["source"],
        store=document["store"],
        out=out,
        rows={row.name: row for row in rows},
        owner=owner,
        phase=document["phase"],
        scenes_at_once=document["scenes_at_once"],
        started=document["started"],
        updated=document["updated"],
        remarks=document["remarks"],
        models=document.get("models", {}),
    )
    if state.phase == "running" and (owner is None or owner.is_dead()):
        state.phase = "stopped (killed)"
        end_running(state, "the batch was killed; the same command goes on from there")
    return state


def end_running(state: CollectionState, reason: str) -> None:
    """Mark the scenes that were running as stopped."""
    for row in state.rows.values():
        if row.status == "running":
            row.status, row.reasons, row.running = "stopped", [reason], []


def failed_names(out: Path) -> tuple[str, ...]:
    """Return the scenes that ``failed.json`` lists; WrongUse if there is none."""
    path = out / FAILED
    try:
        return tuple(scene["name"] for scene in json.loads(path.read_bytes())["scenes"])
    except FileNotFoundError:
        raise WrongUse(f"there is no {path}: run the batch without --only first") from None
    except (ValueError, KeyError, TypeError) as error:
        raise WrongUse(f"{path} cannot be read ({error}): run the batch without --only") from error


@contextmanager
def only_runner(out: Path) -> Iterator[None]:
    """Be the only batch that writes to a folder; WrongUse if there is another.

    The lock is the folder's own: it leaves no file, and dies with its owner.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(out, os.O_RDONLY | os.O_CLOEXEC)
    except OSError as error:
        raise PackageError(
            f"{out} cannot be written to ({error.strerror}): give another --out"
        ) from error
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise WrongUse(
            f"a batch is running into {out}: see `garden status {out}`, or give another --out"
        ) from None
    try:
        yield
    finally:
        os.close(descriptor)


def write_beside(path: Path, text: str) -> None:
    """Replace a file in one step; PackageError if it cannot be written."""
    partial = path.with_name(f".{path.name}.partial")
    try:
        partial.write_text(text, "utf-8")
        partial.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            partial.unlink()
        raise PackageError(
            f"{path} could not be written ({error.strerror}): free some space or give another --out"
        ) from error


def _dump(document: dict[str, Any]) -> str:
    return json.dumps(document, indent=1) + "\n"
