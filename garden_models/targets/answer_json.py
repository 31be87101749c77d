"""Find the entries in what a language model answered, whatever stands around them.

Models that were asked for JSON alone also give fences, prose, thoughts, wrappers, Python
literals, trailing commas, and answers that end in the middle.
"""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from garden_models.scene import BadInput

LONGEST = 200_000
"""Characters that are looked at."""

BOX_KEYS = ("box_2d", "bbox_2d", "box", "bbox", "bounding_box", "boundingBox", "coordinates")
LIST_KEYS = ("targets", "objects", "boxes", "detections", "items", "results", "proposals")
_STARTS = 2000
_SHOWN = 160
_THOUGHTS = re.compile(r"<think(?:ing)?>.*?</think(?:ing)?>", re.DOTALL)
_FENCE = re.compile(r"```[\w-]*\s*\n?(.*?)(?:```|\Z)", re.DOTALL)
_TRAILING_COMMA = re.compile(r",(\s*[}\]])")

Entry = dict[str, Any]


@dataclass
class FoundEntries:
    """The entries of an answer, in its order; ``notes`` say what had to be mended.

    ``removed`` are the entries of the list of that name.
    """

    entries: list[Entry] = field(default_factory=list)
    removed: list[Entry] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def find_entries(text: str) -> FoundEntries:
    """Return the entries of an answer; BadInput if it holds none and no empty list either."""
    said = _THOUGHTS.sub("", text[:LONGEST]).strip()
    if not said:
        raise BadInput("the answer is empty")
    pieces = (*_FENCE.findall(said), said)
    for piece in pieces:
        found = _of_piece(piece)
        if found is not None:
            return found
    loose = max((_loose_entries(piece) for piece in pieces), key=len)
    if loose:
        note = f"the answer broke off or was no JSON list; whole entries read from it: {len(loose)}"
        return FoundEntries(loose, notes=[note])
    raise BadInput(f"the answer holds no list of boxes: {shortened(said)}")


def shortened(text: str, most: int = _SHOWN) -> str:
    """Return a text on one line, cut if it is long."""
    line = " ".join(text.split())
    return line if len(line) <= most else line[:most].rstrip() + " ..."


def _of_piece(piece: str) -> FoundEntries | None:
    """Return the entries of the first value that is a list of them, in whatever wrapper.

    A value that takes the text from its first bracket goes before what lies inside one.
    """
    readings = [_decoded(mended) for mended in (piece, _TRAILING_COMMA.sub(r"\1", piece))]
    readings.append(_python_literal(piece))
    for outermost in (True, False):
        for values in readings:
            for start, value in values[:1] if outermost else values:
                if outermost and start != _first_bracket(piece):
                    continue
                found = None if _is_entry(value) else _entries_of(value)
                if found is not None:
                    return found
    return None


def _decoded(piece: str) -> list[tuple[int, Any]]:
    """Return the values that can be decoded in a text with where they start."""
    decoder, end = json.JSONDecoder(), 0
    values: list[tuple[int, Any]] = []
    for tried, match in enumerate(re.finditer(r"[\[{]", piece)):
        if tried == _STARTS:
            break
        if match.start() < end:
            continue
        try:
            value, end = decoder.raw_decode(piece, match.start())
        except (ValueError, RecursionError):
            continue
        values.append((match.start(), value))
    return values


def _first_bracket(piece: str) -> int:
    return min((i for i in (piece.find("["), piece.find("{")) if i >= 0), default=-1)


def _python_literal(piece: str) -> list[tuple[int, Any]]:
    start, end = _first_bracket(piece), max(piece.rfind("]"), piece.rfind("}"))
    if not 0 <= start < end:
        return []
    try:
        return [(start, ast.literal_eval(piece[start : end + 1]))]
    except (ValueError, SyntaxError, RecursionError, MemoryError):
        return []


def _loose_entries(piece: str) -> list[Entry]:
    """Return the whole entries that stand in a text with no whole list around them."""
    found = [value for _start, value in _decoded(piece) if _is_entry(value)]
    innermost = []
    for match in re.finditer(r"\{[^{}]*\}", piece):
        values = _decoded(_TRAILING_COMMA.sub(r"\1", match.group()))
        values = values[:1] or _python_literal(match.group())
        innermost += [value for _start, value in values if _is_entry(value)]
    return max(found, innermost, key=len)


def _is_entry(value: Any) -> bool:
    return isinstance(value, dict) and has_box(value)


def has_box(entry: Entry) -> bool:
    """Tell whether an entry gives a box, of whatever form."""
    return any(key in entry for key in BOX_KEYS)


def _entries_of(value: Any, depth: int = 0) -> FoundEntries | None:
    """Return the entries of a decoded value, None if it is something else."""
    if depth > 4:
        return None
    if isinstance(value, list):
        return _of_list(value, depth)
    if not isinstance(value, dict):
        return None
    for key in LIST_KEYS:
        if isinstance(value.get(key), list):
            listed = _of_list(value[key], depth) or FoundEntries()
            listed.removed = [e if isinstance(e, dict) else {"name": e} for e in _removed(value)]
            return listed
    return _of_mapping(value) or _first_inside(value.values(), depth)


def _of_list(value: list[Any], depth: int) -> FoundEntries | None:
    entries = [item for item in value if isinstance(item, dict)]
    if any(has_box(entry) for entry in entries) or not value:
        return FoundEntries(entries)
    return _first_inside(entries, depth)


def _first_inside(values: Iterable[Any], depth: int) -> FoundEntries | None:
    inside = (_entries_of(value, depth + 1) for value in values)
    return next((found for found in inside if found is not None), None)


def _of_mapping(value: dict[str, Any]) -> FoundEntries | None:
    """Return the entries of ``{name: box}``, ``{name: entry}`` or ``{photo: [entries]}``."""
    entries: list[Entry] = []
    for key, item in value.items():
        if isinstance(item, dict) and has_box(item):
            entries.append({"name": key, **item})
        elif isinstance(item, list) and len(item) == 4 and not any(map(_is_nested, item)):
            entries.append({"name": key, "box": item})
        elif isinstance(item, list) and item and all(isinstance(e, dict) for e in item):
            entries += [{"photo": key, **e} for e in item if has_box(e)]
    return FoundEntries(entries) if entries else None


def _removed(value: dict[str, Any]) -> list[Any]:
    removed = value.get("removed", [])
    return removed if isinstance(removed, list) else []


def _is_nested(value: Any) -> bool:
    return isinstance(value, list | dict)
