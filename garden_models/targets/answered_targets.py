"""Turn a model's answer into targets that the pipeline can take, saying what was mended."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from garden_models.scene import BadInput, Target
from garden_models.targets.answer_json import Entry, find_entries
from garden_models.targets.box_convention import BoxConvention
from garden_models.targets.box_repair import OutsidePhoto, Unusable, read_box
from garden_models.targets.boxes import check_name
from garden_models.targets.shown_photos import ShownPhoto

NAME_KEYS = ("name", "label", "object", "title", "class", "category")
PHOTO_KEYS = ("photo", "image", "photo_id", "image_id", "view", "frame")
WHY_KEYS = ("why", "reason", "description")
LONGEST_NAME = 48
UNNAMED = "object"


@dataclass(frozen=True)
class AnsweredTarget:
    """A target, what the model gave as its reason, and what had to be mended.

    ``said_name`` is the name as it was written.
    """

    target: Target
    why: str = ""
    said_name: str = ""
    mended: tuple[str, ...] = ()


@dataclass(frozen=True)
class Answer:
    """What an answer comes down to.

    ``removed`` are names with their reasons. ``dropped`` are sentences about entries of
    which nothing could be made, ``notes`` about the answer as a whole.
    """

    targets: tuple[AnsweredTarget, ...]
    removed: tuple[tuple[str, str], ...] = ()
    dropped: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def read_answer(text: str, photos: Sequence[ShownPhoto], convention: BoxConvention) -> Answer:
    """Return the targets of an answer, in its order, names not yet made unique.

    Raises BadInput if there is no list of boxes in it.
    """
    found = find_entries(text)
    targets, dropped, outside = _targets(found.entries, photos, convention, turned=False)
    if outside and convention.startswith("xyxy_px"):
        other = _targets(found.entries, photos, convention, turned=True)
        if not other[2]:
            targets, dropped = other[:2]
            found.notes.append(
                "the boxes only fit their photos with across and down in the place of each other, "
                "and were read so"
            )
    removed = tuple(
        (_text(entry, NAME_KEYS), _text(entry, WHY_KEYS))
        for entry in found.removed
        if _text(entry, NAME_KEYS)
    )
    return Answer(tuple(targets), removed, tuple(dropped), tuple(found.notes))


def _targets(
    entries: Sequence[Entry],
    photos: Sequence[ShownPhoto],
    convention: BoxConvention,
    *,
    turned: bool,
) -> tuple[list[AnsweredTarget], list[str], int]:
    """Return the targets, what was dropped and why, and how many boxes lay outside."""
    targets, dropped, outside = [], [], 0
    for entry in entries:
        said = _text(entry, NAME_KEYS)
        try:
            targets.append(_target(entry, said, photos, convention, turned=turned))
        except Unusable as error:
            dropped.append(f"{said[:LONGEST_NAME] or 'an entry without a name'}: {error}")
            outside += isinstance(error, OutsidePhoto)
    return targets, dropped, outside


def clean_name(said: str) -> str:
    """Return a name that is safe as a folder's and has no spaces."""
    words = re.sub(r"[^\w.\-]+", "_", said.strip())
    name = words.strip("_.-")[:LONGEST_NAME].rstrip("_.-") or UNNAMED
    while len(name.encode(errors="replace")) > 3 * LONGEST_NAME:
        name = name[:-1]
    try:
        return check_name(name, "target")
    except BadInput:
        return UNNAMED


def _target(
    entry: Entry,
    said: str,
    photos: Sequence[ShownPhoto],
    convention: BoxConvention,
    *,
    turned: bool,
) -> AnsweredTarget:
    photo = _photo(entry, photos)
    box, mended = read_box(entry, convention, photo.size, photo.original, turned=turned)
    name = clean_name(said)
    if name != re.sub(r"\s+", "_", said.strip()):
        mended.append(f"its name was {said[:LONGEST_NAME]!r}" if said else "it had no name")
    return AnsweredTarget(Target(name, photo.name, box), _text(entry, WHY_KEYS), said, (*mended,))


def _photo(entry: Entry, photos: Sequence[ShownPhoto]) -> ShownPhoto:
    """Return the photo that an entry names: by label, number, or the file's name."""
    said = next((entry[key] for key in PHOTO_KEYS if entry.get(key) not in (None, "")), None)
    if said is None:
        if len(photos) == 1:
            return photos[0]
        raise Unusable("it names no photo")
    if isinstance(said, float) and said.is_integer():
        said = int(said)
    words = str(said).strip().lower()
    by_name = {photo.name.lower(): photo for photo in photos}
    number = re.fullmatch(r"(?:p|photo|image|view|frame)?[\s_#-]*(\d{1,6})", words)
    labelled = {photo.label.lower(): photo for photo in photos}
    label = f"p{int(number.group(1))}" if number else words
    found = by_name.get(words) or labelled.get(label)
    if found is None:
        raise Unusable(f"it names the photo {words[:40]!r}, which was not shown")
    return found


def _text(entry: Entry, keys: tuple[str, ...]) -> str:
    for key in keys:
        value = entry.get(key)
        if isinstance(value, str | int | float) and not isinstance(value, bool):
            return " ".join(str(value).split())
    return ""
