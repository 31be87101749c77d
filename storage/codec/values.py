"""Write a value as the members of an object, and read it back.

An object is a Zarr v3 group. Its attributes hold the value's tree, readable as plain JSON;
beside the arrays lie ``texts/``, ``blobs/`` and ``tables/``.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from storage.canonical import is_array
from storage.codec import tree as trees
from storage.codec.content import encoded_digest
from storage.codec.packing import pack
from storage.codec.tables import read_table, table_bytes
from storage.errors import CorruptArtifact, SchemaMismatch
from storage.manifest import Manifest
from storage.members import MemberReader, MemberWriter

if TYPE_CHECKING:
    import numpy as np
    import zarr

ROOT = "zarr.json"


def write_value(value: object, members: MemberWriter) -> Manifest:
    """Write all members of ``value`` and return the manifest that seals them."""
    kind, schema = trees.kind_of(value)
    encoded = trees.encode(value)
    content = encoded_digest(encoded, schema)
    arrays = {path: leaf for path, leaf in encoded.leaves.items() if is_array(leaf)}
    packs, places = pack(arrays)
    leaves: dict[str, Any] = {path: {"array": place} for path, place in places.items()}
    others = {path: leaf for path, leaf in encoded.leaves.items() if path not in arrays}
    for number, (path, leaf) in enumerate(others.items()):
        leaves[path] = _write_other(number, leaf, members)
    if arrays:
        from storage.codec.arrays import write_arrays

        write_arrays(packs, arrays, members)
    stored = {"kind": kind, "schema": schema, "tree": encoded.tree, "leaves": leaves}
    document = {"attributes": {"garden": stored}, "node_type": "group", "zarr_format": 3}
    text = json.dumps(document, sort_keys=True, ensure_ascii=False, allow_nan=False)
    members.put(ROOT, text.encode())
    return Manifest(kind, schema, content, dict(members.members))


def _write_other(number: int, leaf: Any, members: MemberWriter) -> dict[str, str]:
    if isinstance(leaf, str):
        name, path, data = "text", f"texts/{number:04d}.txt", leaf.encode()
    elif isinstance(leaf, bytes):
        name, path, data = "bytes", f"blobs/{number:04d}.bin", leaf
    else:
        name, path, data = "table", f"tables/{number:04d}.parquet", bytes(table_bytes(leaf))
    members.put(path, data)
    return {name: path}


class ValueReader:
    """Read one object's value, all of it or some fields; verified as it is read."""

    def __init__(self, members: MemberReader) -> None:
        self._members = members
        self.manifest = members.manifest
        try:
            stored = json.loads(members.get(ROOT))["attributes"]["garden"]
            self._tree, self._leaves = stored["tree"], stored["leaves"]
        except (KeyError, ValueError, TypeError) as error:
            raise CorruptArtifact(members.digest, f"unreadable attributes: {error}") from error
        self._arrays: Any = None

    def value(self, expected: object) -> Any:
        """Return the whole value as ``expected`` (a class or a type hint)."""
        self._check(expected)
        self._members.read_ahead()
        value = trees.decode(self._tree, expected, self._leaf)
        self._members.check_rest()
        return value

    def fields(self, expected: type, names: tuple[str, ...]) -> dict[str, Any]:
        """Return some fields of a dataclass; the others are not touched."""
        self._check(expected)
        hints = trees.field_hints(expected)
        return {
            name: trees.decode(trees.field_tree(self._tree, name), hints[name], self._leaf)
            for name in names
        }

    def array(self, path: str) -> tuple[zarr.Array, tuple[Any, ...]]:
        """Return the Zarr array in which the leaf ``views/0/rgb`` lies, and where in it.

        The place is () for all of it, (index,) or (start, stop): slice no more than needed.
        """
        entry = self._leaves.get(path, {})
        if "array" not in entry:
            raise SchemaMismatch(f"the stored {self.manifest.kind} has no array at {path!r}")
        name, *place = entry["array"]
        return self._array_reader().open(name), tuple(place)

    def _check(self, expected: object) -> None:
        if not isinstance(expected, type):
            return
        kind, schema = trees.kind_of(expected)
        if (self.manifest.kind, self.manifest.schema) != (kind, schema):
            raise SchemaMismatch(
                f"artifact {self._members.digest[:15]} is a {self.manifest.kind}"
                f" ({self.manifest.schema}), expected a {kind} ({schema})"
            )

    def _array_reader(self) -> Any:
        if self._arrays is None:
            from storage.codec.arrays import ArrayReader

            self._arrays = ArrayReader(self._members)
        return self._arrays

    def _leaf(self, path: str) -> Any:
        entry = self._leaves[path]
        if "array" in entry:
            array: np.ndarray = self._array_reader().leaf(entry["array"])
            return array
        if "text" in entry:
            return self._members.get(entry["text"]).decode()
        if "bytes" in entry:
            return self._members.get(entry["bytes"])
        return read_table(self._members.get(entry["table"]))
