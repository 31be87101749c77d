"""Bring a store back to its invariants, whatever happened to it, without losing a good result.

Nothing that was damaged is served or thrown away: it goes to quarantine. Everything is looked
at again while no name is being made, so that a repair beside running work is safe.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

from storage import actions, catalogue, expire
from storage.check import Problem, action_problems, check_store, object_problem
from storage.digest import digest_bytes, hexadecimal
from storage.forget import forget, quarantine
from storage.medium import Level, Medium


@dataclass(frozen=True)
class Repaired:
    """What was wrong, where, and what was done about it."""

    where: str
    what: str
    done: str


def repair(medium: Medium, level: Level = "full") -> list[Repaired]:
    """Mend everything that ``check_store`` finds, and clear up; return what was done."""
    done = list(_mend(medium, check_store(medium, level), level))
    done += _leftovers(medium)
    return done


def _mend(medium: Medium, problems: list[Problem], level: Level) -> Iterator[Repaired]:
    """Objects first, with their actions; then the actions that still have something wrong."""
    for problem in problems:
        with medium.collecting():
            done = _mend_one(medium, problem, level)
        if done:
            yield Repaired(problem.where, problem.what, done)


def _mend_one(medium: Medium, problem: Problem, level: Level) -> str:
    if problem.kind == "object":
        if object_problem(medium, problem.where, level) is None:
            return ""
        moved = quarantine(medium, problem.where)
        return "moved to quarantine" if moved else ""
    if problem.kind == "dangling":
        record = actions.read_action(medium, problem.where)
        name = actions.action_name(problem.where)
        if record is None or not action_problems(medium, name, set()):
            return ""
        forget(medium, [record])
        return "forgotten"
    if problem.kind == "action" and not action_problems(medium, problem.where, set()):
        return ""
    return _to_quarantine(medium, problem.where)


def _to_quarantine(medium: Medium, name: str) -> str:
    """Move a document that cannot be read to quarantine."""
    data = medium.read(name)
    if data is None:
        return ""
    ward = f"quarantine/{hexadecimal(digest_bytes(data))[:16]}-{time.time_ns()}"
    medium.create(f"{ward}/{name}", data)
    medium.delete(name)
    return "moved to quarantine"


def _leftovers(medium: Medium) -> Iterator[Repaired]:
    """Remove what hinders nobody but should not be there."""
    if swept := medium.sweep():
        yield Repaired("tmp, trash", f"{swept} things that dead processes left", "removed")
    if void := expire.drop_void(medium):
        yield Repaired("leases, pins", f"{void} of dead or late owners", "removed")
    stale = [
        name for name in medium.names("latest/") if actions.pointed_action(medium, name) is None
    ]
    medium.delete(*stale)
    for name in stale:
        yield Repaired(name, "a pointer that points nowhere", "removed")
    for name in catalogue.damaged_parts(medium):
        medium.delete(name)
        yield Repaired(name, "a damaged part of the catalogue", "removed: it is made again")
