"""Keep one target of each physical thing, and give each a name of its own."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from garden_models.scene import Target
from garden_models.targets.answered_targets import AnsweredTarget
from garden_models.targets.box_convention import Box

SAME_BOX = 0.85
"""Intersection over union beyond which two boxes of one photo mean the same thing."""


def without_repeats(
    answered: Sequence[AnsweredTarget],
) -> tuple[tuple[AnsweredTarget, ...], list[str]]:
    """Return one target a thing, in order, with names of their own; and what was left out.

    Two boxes of one photo that nearly agree are the same thing. One name in two photos is
    the same thing, too, and stays where its box is the largest; one name for two boxes of
    one photo are two things, which get numbers.
    """
    kept: list[AnsweredTarget] = []
    notes: list[str] = []
    for one in answered:
        twin = next((k for k in kept if _same_box(k, one)), None)
        if twin is None:
            kept.append(one)
        else:
            notes.append(f"{one.target.name}: the same box as {twin.target.name}, left out")
    kept, elsewhere = _in_one_photo_each(kept)
    targets = with_own_names([one.target for one in kept])
    named = (dataclasses.replace(k, target=t) for k, t in zip(kept, targets, strict=True))
    return tuple(named), notes + elsewhere


def with_own_names(targets: Sequence[Target]) -> tuple[Target, ...]:
    """Return the targets, numbered where a name comes again."""
    taken: set[str] = set()
    named = []
    for target in targets:
        name, number = target.name, 1
        while name.casefold() in taken:
            number += 1
            name = f"{target.name}_{number}"
        taken.add(name.casefold())
        named.append(dataclasses.replace(target, name=name))
    return tuple(named)


def overlap(a: Box, b: Box) -> float:
    """Return the intersection of two boxes over their union (0..1)."""
    across = min(a[2], b[2]) - max(a[0], b[0])
    down = min(a[3], b[3]) - max(a[1], b[1])
    shared = max(0.0, across) * max(0.0, down)
    union = area(a) + area(b) - shared
    return shared / union if union > 0 else 0.0


def area(box: Box) -> float:
    """Return the area of a box."""
    return (box[2] - box[0]) * (box[3] - box[1])


def _same_box(a: AnsweredTarget, b: AnsweredTarget) -> bool:
    same_photo = a.target.photo == b.target.photo
    return same_photo and overlap(a.target.box, b.target.box) > SAME_BOX


def _in_one_photo_each(
    answered: Sequence[AnsweredTarget],
) -> tuple[list[AnsweredTarget], list[str]]:
    largest: dict[str, AnsweredTarget] = {}
    for one in answered:
        name = one.target.name.casefold()
        if name not in largest or area(one.target.box) > area(largest[name].target.box):
            largest[name] = one
    kept, notes = [], []
    for one in answered:
        chosen = largest[one.target.name.casefold()].target.photo
        if one.target.photo == chosen:
            kept.append(one)
        else:
            notes.append(
                f"{one.target.name}: boxed in {one.target.photo} too, where it is smaller than in "
                f"{chosen}; left out there"
            )
    return kept, notes
