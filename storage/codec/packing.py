"""Say which leaves share one Zarr array, so that an object has few files.

Arrays at the same place of repeated items (``views/0/rgb``, ``views/1/rgb``, ...) become
one array ``views/rgb``: stacked when their shapes agree, end to end along the first axis
when only that differs. A large one is cut into chunks, an item or about a mebibyte each,
inside shards, so that one item can be read alone.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from storage.canonical import dtype_name

CHUNK_BYTES = 1 << 20
SHARD_BYTES = 64 << 20
_UNSAFE = re.compile(r"[^A-Za-z0-9_-]")

Place = list[Any]
"""Where a leaf lies: [name], [name, index] of a stack, or [name, start, stop] of rows."""


@dataclass(frozen=True)
class Pack:
    """One Zarr array: which leaves it holds and how it is cut (shapes in elements)."""

    name: str
    leaves: tuple[str, ...]
    stacked: bool
    shape: tuple[int, ...]
    chunks: tuple[int, ...]
    shards: tuple[int, ...] | None


def pack(arrays: dict[str, Any]) -> tuple[list[Pack], dict[str, Place]]:
    """Return the Zarr arrays to write, and where each leaf lies in them."""
    groups: dict[tuple[str, str, tuple[int, ...], int], list[str]] = {}
    for path, array in arrays.items():
        key = (_pattern(path), dtype_name(array), tuple(array.shape[1:]), array.ndim)
        groups.setdefault(key, []).append(path)
    packs: list[Pack] = []
    places: dict[str, Place] = {}
    taken: set[str] = set()
    for (pattern, *_), paths in groups.items():
        name = _free_name(pattern, taken)
        packs.append(_pack(name, paths, arrays, places))
    return packs, places


def _pack(name: str, paths: list[str], arrays: dict[str, Any], places: dict[str, Place]) -> Pack:
    first = arrays[paths[0]]
    itemsize = first.dtype.itemsize
    if len(paths) == 1:
        places[paths[0]] = [name]
        return _cut(name, paths, False, tuple(first.shape), itemsize)
    shapes = {tuple(arrays[path].shape) for path in paths}
    if len(shapes) == 1:
        for index, path in enumerate(paths):
            places[path] = [name, index]
        return _cut(name, paths, True, (len(paths), *first.shape), itemsize)
    start = 0
    for path in paths:
        stop = start + arrays[path].shape[0]
        places[path] = [name, start, stop]
        start = stop
    return _cut(name, paths, False, (start, *first.shape[1:]), itemsize)


def _cut(name: str, paths: list[str], stacked: bool, shape: tuple[int, ...], itemsize: int) -> Pack:
    if not shape:
        return Pack(name, tuple(paths), stacked, (), (), None)
    row = itemsize
    for extent in shape[1:]:
        row *= max(extent, 1)
    rows = max(1, min(shape[0], CHUNK_BYTES // row))
    tail = tuple(max(extent, 1) for extent in shape[1:])
    if rows >= shape[0]:
        return Pack(name, tuple(paths), stacked, shape, (max(shape[0], 1), *tail), None)
    in_shard = max(1, min(-(-shape[0] // rows), SHARD_BYTES // (rows * row)))
    return Pack(name, tuple(paths), stacked, shape, (rows, *tail), (rows * in_shard, *tail))


def _pattern(path: str) -> str:
    """Return a path without its indices, in characters that any file system takes."""
    words = [word for word in path.split("/") if not word.isdigit()]
    return "/".join(_UNSAFE.sub(lambda m: f"_x{ord(m[0]):x}_", word) for word in words) or "array"


def _free_name(pattern: str, taken: set[str]) -> str:
    """Return a name that is neither taken nor lies inside, or around, a taken one."""
    number = 0
    while True:
        name = pattern if number == 0 else f"{pattern}.{number}"
        if not any(
            name == other or name.startswith(other + "/") or other.startswith(name + "/")
            for other in taken
        ):
            taken.add(name)
            return name
        number += 1
