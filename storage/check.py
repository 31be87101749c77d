"""Check a whole store against its invariants, changing nothing."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from storage import objects
from storage.actions import ActionRecord, all_action_paths
from storage.errors import CorruptArtifact, MissingArtifact
from storage.objects import Level


@dataclass(frozen=True)
class Problem:
    """What a check of the store found."""

    where: str
    what: str


def check_store(store: Path, level: Level) -> list[Problem]:
    """Return every damaged object, and every action that is unreadable or dangles."""
    problems: list[Problem] = []
    whole: set[str] = set()
    for digest in objects.all_objects(store):
        try:
            objects.verify(store, digest, level)
            whole.add(digest)
        except (CorruptArtifact, MissingArtifact, ValueError) as error:
            problems.append(Problem(digest, str(error)))
    for path in all_action_paths(store):
        problems += _action_problems(path, whole)
    return problems


def _action_problems(path: Path, whole: set[str]) -> list[Problem]:
    try:
        record = ActionRecord.from_bytes(path.read_bytes())
    except (ValueError, KeyError, OSError) as error:
        return [Problem(str(path), f"unreadable action record: {error}")]
    name = f"b3:{path.parent.name}{path.stem}"
    if record.key != name:
        return [Problem(name, "the action record names another key")]
    return [
        Problem(name, f"its output {output.object[:15]} is missing or damaged")
        for output in record.outputs.values()
        if output.object not in whole
    ]
