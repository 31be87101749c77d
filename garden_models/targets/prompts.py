"""Word the two questions of the paper's supplement: propose, then check and repair."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from garden_models.scene import Target
from garden_models.targets.box_convention import BoxConvention, described, key_of, written_box
from garden_models.targets.shown_photos import ShownPhoto

PROMPTS_VERSION = 1
"""Part of the step's key with the texts themselves."""

_SCENE = """\
The {count} photos {labels} show one scene from different places. It is being rebuilt for a \
physics simulation with this goal:
{goal}
"""

_WHAT = """\
A target is one rigid thing that the goal needs as a body of its own: it could be picked up, \
pushed or knocked over. Not targets: walls, floor, ceiling, windows, doors, built-in furniture; \
the table, shelf or counter that only carries the others, unless the goal moves it; curtains, \
clothing, cables, paper and other soft or thin things; mirrors; people and animals; and what no \
photo shows nearly whole.
"""

_FORM = """\
For each target give
- name: a short English name in lower case with underscores, different for every target \
(red_mug and blue_mug, not mug twice);
- photo: the label of the one photo that shows it best, large, whole and least hidden;
- {key}: the tight box around all its visible pixels, and nothing else, in that photo: {written};
- why: in a few words, what the goal needs it for.
List each physical thing once, however many photos show it, the most important first, \
{most} at most.
"""

_PROPOSE = """\
{scene}
Propose the targets. {what}
{form}
Answer with JSON alone: {example}. If there is no target, give an empty list.
"""

_CRITIC = """\
{scene}
These targets were proposed; their boxes are drawn into the photos, numbered in this order:
{listed}

{what}
Check every box against the photos: it must hold the thing that is named, all that is seen of it, \
tightly, in the photo that is named. Repair boxes that are inaccurate, cut the thing off or hold \
another one. Add targets that the goal obviously needs and the list omits. Remove what is no \
target or is not there, and all but one of those that are the same physical thing.

{form}
Answer with JSON alone: {example}. \
"targets" is the whole list as it should be: repaired, added, and unchanged ones as they are, \
under the names that they have. "removed" names what you took out of the list, and why.
"""


def proposal_prompt(
    photos: Sequence[ShownPhoto], goal: str, convention: BoxConvention, most: int
) -> str:
    """Return the first question."""
    example = {"targets": [_example(convention)]}
    return _PROPOSE.format(
        scene=_scene(photos, goal),
        what=_WHAT,
        form=_form(convention, most),
        example=json.dumps(example),
    )


def critic_prompt(
    photos: Sequence[ShownPhoto],
    goal: str,
    convention: BoxConvention,
    most: int,
    targets: Sequence[Target],
) -> str:
    """Return the second question, about the targets of the first one's answer."""
    shown = {photo.name: photo for photo in photos}
    listed = []
    for target in targets:
        photo = shown[target.photo]
        box = written_box(target.box, convention, photo.size, photo.original)
        entry = {"name": target.name, "photo": photo.label, key_of(convention): box}
        listed.append(json.dumps(entry, ensure_ascii=False))
    example = {
        "targets": [_example(convention)],
        "removed": [{"name": "window", "why": "part of the building"}],
    }
    return _CRITIC.format(
        scene=_scene(photos, goal),
        listed="\n".join(listed),
        what=_WHAT,
        form=_form(convention, most),
        example=json.dumps(example),
    )


def proposal_schema(convention: BoxConvention) -> dict[str, Any]:
    """Return the JSON schema of the first answer."""
    return _object({"targets": _targets(convention)})


def critic_schema(convention: BoxConvention) -> dict[str, Any]:
    """Return the JSON schema of the second answer."""
    text = {"type": "string"}
    removed = {"type": "array", "items": _object({"name": text, "why": text})}
    return _object({"targets": _targets(convention), "removed": removed})


def _targets(convention: BoxConvention) -> dict[str, Any]:
    text = {"type": "string"}
    number = {"type": "number" if convention == "xyxy_unit" else "integer"}
    box = {"type": "array", "items": number, "minItems": 4, "maxItems": 4}
    entry = _object({"name": text, "photo": text, key_of(convention): box, "why": text})
    return {"type": "array", "items": entry}


def _object(properties: dict[str, Any]) -> dict[str, Any]:
    return {
        "type": "object",
        "properties": properties,
        "required": list(properties),
        "additionalProperties": False,
    }


def _scene(photos: Sequence[ShownPhoto], goal: str) -> str:
    sizes = ", ".join(f"{p.label} ({p.size[0]} x {p.size[1]} pixels)" for p in photos)
    return _SCENE.format(count=len(photos), labels=sizes, goal=goal.strip())


def _form(convention: BoxConvention, most: int) -> str:
    return _FORM.format(key=key_of(convention), written=described(convention), most=most)


def _example(convention: BoxConvention) -> dict[str, Any]:
    box = written_box((200.0, 300.0, 400.0, 600.0), convention, (1000, 1000), (1000, 1000))
    return {"name": "red_mug", "photo": "P1", key_of(convention): box, "why": "to be picked up"}
