"""Hash the logical value: what it holds, not how it is written.

Another compression, chunking or library version gives the same content digest, so that
steps downstream do not run again for it (invariant EARLY-CUTOFF). Fields that do not count
(``storage.canonical.UNKEYED``: a place, a time that something took) are left out.
"""

from __future__ import annotations

from typing import Any

from storage.canonical import dtype_name, is_array, little_endian
from storage.codec.tables import table_digest
from storage.codec.tree import Encoded, counted, encode, kind_of
from storage.digest import digest_bytes, digest_value


def content_digest(value: object) -> str:
    """Return the content digest of any storable value."""
    _kind, schema = kind_of(value)
    return encoded_digest(encode(value), schema)


def encoded_digest(encoded: Encoded, schema: str) -> str:
    """Return the content digest of a value that was taken apart."""
    tree, paths = counted(encoded.tree)
    leaves = {path: leaf_digest(leaf) for path, leaf in encoded.leaves.items() if path in paths}
    return digest_value((schema, tree, leaves), domain="garden.content/1")


def leaf_digest(leaf: Any) -> tuple[object, ...]:
    """Return what identifies a leaf: its type, shape and a digest of its bytes."""
    if is_array(leaf):
        dtype = dtype_name(leaf)
        data = little_endian(leaf)
        flat = data.reshape(-1).view("u1") if data.size else b""
        return ("array", dtype, tuple(leaf.shape), digest_bytes(memoryview(flat)))
    if isinstance(leaf, str):
        return ("text", digest_bytes(leaf.encode()))
    if isinstance(leaf, bytes):
        return ("bytes", digest_bytes(leaf))
    return ("table", table_digest(leaf))
