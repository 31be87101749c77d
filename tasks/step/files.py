"""Say by name which of the files that a step reads changed.

An action record keeps a file as the plain leaves ``PATH.name``, ``PATH.digest`` and
``PATH.size``, a list of files with an index in ``PATH``. Compared leaf by leaf, one photo
more would shift all that follow; compared by name, it is one photo more.
"""

from __future__ import annotations

import mimetypes
from collections.abc import Mapping
from typing import Any

Leaves = Mapping[str, Any]
SHOWN = 3  # names in a sentence
_WORDS = {"image": "photo", "video": "video"}


def split_files(leaves: Leaves) -> tuple[dict[str, str], dict[str, Any]]:
    """Return the digests of the files among the leaves by name, and all other leaves."""
    paths = {
        path.removesuffix(".digest")
        for path in leaves
        if path.endswith(".digest") and path.removesuffix("digest") + "name" in leaves
    }
    files = {
        str(leaves[f"{path}.name"]): str(leaves[f"{path}.digest"])
        for path in sorted(paths, key=_by_index)
    }
    rest = {path: value for path, value in leaves.items() if path.rpartition(".")[0] not in paths}
    return files, rest


def file_changes(before: Leaves, after: Leaves) -> list[str]:
    """Return what came, went, changed, or only got another name, as sentences."""
    old, new = split_files(before)[0], split_files(after)[0]
    gone = {old[name]: name for name in old if name not in new}
    added, renamed = [], []
    for name in new:
        if name in old:
            continue
        if new[name] in gone:
            renamed.append(f"{gone.pop(new[name])} -> {name}")
        else:
            added.append(name)
    changed = [name for name in new if name in old and new[name] != old[name]]
    outcomes = {
        "changed": changed,
        "added": added,
        "removed": list(gone.values()),
        "renamed": renamed,
    }
    found = [_sentence(names, happened) for happened, names in outcomes.items() if names]
    if not found and list(old) != list(new):
        return ["the files are in another order"]
    return found


def listed(names: list[str], shown: int = SHOWN) -> str:
    """Return the first names, and how many more there are."""
    more = len(names) - shown
    return ", ".join(names[:shown]) + (f" and {more} more" if more > 0 else "")


def counted(names: list[str]) -> str:
    """Return how many files these are: ``1 photo``, ``25 photos``, ``2 files``."""
    return f"{len(names)} {_word(names)}{'s' if len(names) != 1 else ''}"


def _sentence(names: list[str], happened: str) -> str:
    if len(names) == 1 and happened != "renamed":
        return f"{_word(names)} {names[0]} {happened}"
    return f"{counted(names)} {happened}: {listed(names)}"


def _word(names: list[str]) -> str:
    """Return what a user calls these files, from their suffixes."""
    types = [mimetypes.guess_type(name, strict=False)[0] or "" for name in names]
    kinds = {kind.partition("/")[0] for kind in types}
    return _WORDS.get(kinds.pop(), "file") if len(kinds) == 1 else "file"


def _by_index(path: str) -> tuple[tuple[int, str], ...]:
    """Sort ``files.10`` after ``files.9``."""
    return tuple((int(word), "") if word.isdigit() else (-1, word) for word in path.split("."))
