"""Apply what the check of a proposal says: repaired, added and removed targets."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from garden_models.scene import Target
from garden_models.targets.answered_targets import Answer, AnsweredTarget
from garden_models.targets.proposal import TargetChange
from garden_models.targets.repeats import overlap, without_repeats

SAME_THING = 0.5
"""Intersection over union beyond which a target of a new name is a proposed one, renamed."""

UNMOVED = 0.98


@dataclass(frozen=True)
class Checked:
    """The targets after the check, what it changed, and remarks about how it said so."""

    targets: tuple[Target, ...]
    changes: tuple[TargetChange, ...]
    notes: tuple[str, ...]


def apply_check(proposed: Sequence[Target], answer: Answer) -> Checked:
    """Return the targets that the check leaves.

    An entry with a proposed name replaces that target; one of another name that lies on a
    proposed target which the check does not name renames it; others are added. Only what
    the check lists as removed goes: a target that it passes over in silence stays.
    """
    answered, notes = without_repeats(answer.targets)
    by_name = {one.target.name.casefold(): one for one in answered}
    removed = {name.strip().casefold(): why for name, why in answer.removed}
    renamed = _renamed(proposed, answered, removed.keys())
    targets: list[Target] = []
    changes: list[TargetChange] = []
    silent: list[str] = []
    for before in proposed:
        name = before.name.casefold()
        found = by_name.pop(name, None) or by_name.pop(renamed.get(name, ""), None)
        if found is not None:
            targets.append(found.target)
            changes += _difference(before, found)
        elif name in removed:
            changes.append(TargetChange("removed", before, None, removed[name]))
        else:
            targets.append(before)
            silent.append(before.name)
    for found in by_name.values():
        targets.append(found.target)
        changes.append(TargetChange("added", None, found.target, found.why))
    if silent:
        notes.append(f"the critic passed over {', '.join(silent)}, which stay as proposed")
    return Checked(tuple(targets), tuple(changes), tuple(notes))


def _renamed(
    proposed: Sequence[Target], answered: Sequence[AnsweredTarget], removed: Collection[str]
) -> dict[str, str]:
    """Return new names, case-folded, by the proposed ones that the answer does not mention."""
    names = {one.target.name.casefold() for one in answered}
    known = {target.name.casefold() for target in proposed}
    new = [one.target for one in answered if one.target.name.casefold() not in known]
    found: dict[str, str] = {}
    for before in proposed:
        name = before.name.casefold()
        if name in names or name in removed:
            continue
        for after in new:
            same = after.photo == before.photo and overlap(after.box, before.box) > SAME_THING
            if same and after.name.casefold() not in found.values():
                found[name] = after.name.casefold()
                break
    return found


def _difference(before: Target, found: AnsweredTarget) -> list[TargetChange]:
    after = found.target
    changes = []
    if after.name.casefold() != before.name.casefold():
        changes.append(TargetChange("renamed", before, after, found.why))
    if after.photo != before.photo or overlap(after.box, before.box) < UNMOVED:
        changes.append(TargetChange("moved", before, after, found.why))
    return changes
