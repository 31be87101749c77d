"""Check a whole store against its invariants, changing nothing."""

from __future__ import annotations

from dataclasses import dataclass

from storage import objects
from storage.actions import ActionRecord
from storage.errors import CorruptArtifact, MissingArtifact
from storage.medium import Level, Medium


@dataclass(frozen=True)
class Problem:
    """What a check of the store found."""

    where: str
    what: str


def check_store(medium: Medium, level: Level) -> list[Problem]:
    """Return every damaged object, and every action that is unreadable or dangles."""
    problems: list[Problem] = []
    whole: set[str] = set()
    for digest in medium.objects():
        try:
            objects.verify(medium, digest, level)
            whole.add(digest)
        except (CorruptArtifact, MissingArtifact, ValueError) as error:
            problems.append(Problem(digest, str(error)))
    for name in medium.names("actions/"):
        problems += _action_problems(medium, name, whole)
    return problems


def _action_problems(medium: Medium, name: str, whole: set[str]) -> list[Problem]:
    data = medium.read(name)
    if data is None:
        return []  # forgotten meanwhile
    try:
        record = ActionRecord.from_bytes(data)
    except (ValueError, KeyError) as error:
        return [Problem(name, f"unreadable action record: {error}")]
    key = "b3:" + name.removeprefix("actions/").removesuffix(".json").replace("/", "")
    if record.key != key:
        return [Problem(key, "the action record names another key")]
    return [
        Problem(key, f"its output {output.object[:15]} is missing or damaged")
        for output in record.outputs.values()
        if output.object not in whole
    ]
