"""Check a whole store against its invariants, changing nothing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from storage import actions, objects
from storage.actions import ActionRecord
from storage.digest import is_digest
from storage.errors import CorruptArtifact, MissingArtifact, StoreError
from storage.medium import Level, Medium
from storage.pins import pin_documents, read_pin

Kind = Literal["object", "action", "dangling", "pin"]
REPAIR = "run `garden store repair`"


@dataclass(frozen=True)
class Problem:
    """What a check of the store found, where, and what to do about it."""

    kind: Kind
    where: str
    what: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.where}: {self.what}; {self.remedy}"


def check_store(medium: Medium, level: Level) -> list[Problem]:
    """Return every damaged object, and every action or pin that is unreadable or dangles."""
    problems: list[Problem] = []
    whole: set[str] = set()
    for digest in medium.objects():
        problem = object_problem(medium, digest, level)
        if problem is None:
            whole.add(digest)
        else:
            problems.append(problem)
    for name in medium.names("actions/"):
        problems += action_problems(medium, name, whole)
    return problems + list(_pin_problems(medium))


def object_problem(medium: Medium, digest: str, level: Level) -> Problem | None:
    """Return what is wrong with an object, if anything."""
    if not is_digest(digest):
        remedy = f"{REPAIR}: it goes to quarantine"
        return Problem("object", digest, "what stands there is no object", remedy)
    try:
        objects.verify(medium, digest, level)
    except MissingArtifact:
        if digest not in set(medium.objects()):
            return None  # collected meanwhile
        return Problem("object", digest, "it is empty", f"{REPAIR}: it goes to quarantine")
    except CorruptArtifact as error:
        remedy = f"{REPAIR}: it goes to quarantine, and what needs it makes it again"
        return Problem("object", digest, error.reason, remedy)
    return None


def action_problems(medium: Medium, name: str, whole: set[str]) -> list[Problem]:
    """Return what is wrong with an action, given the objects that are known to be whole."""
    data = medium.read(name)
    if data is None:
        return []  # forgotten meanwhile
    try:
        record = ActionRecord.from_bytes(data)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        what = f"unreadable action record ({error})"
        return [Problem("action", name, what, f"{REPAIR}: it goes to quarantine")]
    if not actions.is_action_name(name) or record.key != actions.named_key(name):
        what = f"the action record is of another key, {record.key}"
        return [Problem("action", name, what, f"{REPAIR}: it goes to quarantine")]
    return [
        Problem(
            "dangling",
            record.key,
            f"its output {output.object[:15]} is missing or damaged",
            f"{REPAIR}: it is forgotten, and made again when it is needed",
        )
        for output in record.outputs.values()
        if output.object not in whole and _dangles(medium, name, output.object)
    ]


def _dangles(medium: Medium, name: str, digest: str) -> bool:
    """Look again: it may be that both were published or collected during the check."""
    try:
        objects.verify(medium, digest, "full")
    except (MissingArtifact, CorruptArtifact, ValueError):
        return medium.read(name) is not None
    return False


def _pin_problems(medium: Medium) -> Iterator[Problem]:
    for document in pin_documents(medium):
        try:
            read_pin(medium, document)
        except StoreError as error:
            todo = f"pin what it held again, then {REPAIR}: it goes to quarantine"
            yield Problem("pin", document, str(error), todo)
