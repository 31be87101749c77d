"""Write a noun as a folder of plain files, and read it back: what goes to and from a worker.

``tree.json`` holds the value's tree (``storage.codec.tree``) and every member's size and SHA-256;
arrays are ``.npy`` files without pickles. Who reads is told the digest of ``tree.json``, so that
a folder that was changed, cut short or mixed up with another one is not taken for an answer.
"""

from __future__ import annotations

import hashlib
import io
import json
import re
from pathlib import Path
from typing import Any

import numpy as np

from storage.canonical import dtype_name, is_array
from storage.codec.tree import decode, encode
from storage.errors import SchemaMismatch, Unstorable

TREE = "tree.json"
_FORMAT = "garden.payload/1"
_MEMBER = re.compile(r"[0-9]{4,}\.(npy|txt|bin)")
_HASHED_AT_ONCE = 1 << 20


class BadPayload(ValueError):
    """A folder does not hold what it should; the message says what is wrong with it."""


def write_payload(value: object, folder: Path) -> str:
    """Write a dataclass of arrays, numbers and texts into a new folder; return its digest.

    Raises BadPayload if something in it cannot be written.
    """
    folder.mkdir(mode=0o700)
    try:
        encoded = encode(value)
        leaves = {
            path: _write_leaf(number, leaf, folder)
            for number, (path, leaf) in enumerate(encoded.leaves.items())
        }
    except Unstorable as error:
        raise BadPayload(str(error)) from None
    members = {name: [(folder / name).stat().st_size, _digest(folder / name)] for name in
               leaves.values()}  # fmt: skip
    document = {"format": _FORMAT, "tree": encoded.tree, "leaves": leaves, "members": members}
    data = json.dumps(document, sort_keys=True, allow_nan=False).encode()
    (folder / TREE).write_bytes(data)
    return hashlib.sha256(data).hexdigest()


def read_payload(folder: Path, digest: str, expected: type) -> Any:
    """Return the value of a folder, every member checked; BadPayload if it is not whole.

    Args:
        folder: where it lies.
        digest: what ``write_payload`` returned.
        expected: the dataclass that it must be.
    """
    document = _document(folder, digest)
    try:
        leaves, members = document["leaves"], document["members"]
        for name, (size, member_digest) in members.items():
            _check_member(folder, name, size, member_digest)
        value = decode(
            document["tree"],
            expected,
            lambda path: _read_leaf(folder, _listed(leaves[path], members)),
        )
    except SchemaMismatch as error:
        raise BadPayload(str(error)) from None
    except (KeyError, TypeError, AttributeError) as error:
        raise BadPayload(f"{TREE} is not in order ({type(error).__name__}: {error})") from None
    if not isinstance(value, expected):
        raise BadPayload(f"it is a {type(value).__name__}, expected a {expected.__name__}")
    return value


def _document(folder: Path, digest: str) -> dict[str, Any]:
    try:
        data = (folder / TREE).read_bytes()
    except OSError as error:
        raise BadPayload(f"{TREE} cannot be read ({error.strerror})") from None
    if hashlib.sha256(data).hexdigest() != digest:
        raise BadPayload(f"{TREE} is not the one that was announced")
    try:
        document = json.loads(data)
    except ValueError as error:
        raise BadPayload(f"{TREE} is no JSON ({error})") from None
    if not isinstance(document, dict) or document.get("format") != _FORMAT:
        raise BadPayload(f"{TREE} is no {_FORMAT}")
    return document


def _write_leaf(number: int, leaf: Any, folder: Path) -> str:
    if is_array(leaf):
        dtype_name(leaf)
        name = f"{number:04d}.npy"
        np.save(folder / name, leaf, allow_pickle=False)
        return name
    if not isinstance(leaf, str | bytes):
        raise Unstorable(f"a {type(leaf).__name__} cannot go to a model or come from one")
    name = f"{number:04d}.{'txt' if isinstance(leaf, str) else 'bin'}"
    (folder / name).write_bytes(leaf.encode() if isinstance(leaf, str) else leaf)
    return name


def _check_member(folder: Path, name: str, size: int, digest: str) -> None:
    if not _MEMBER.fullmatch(name):
        raise BadPayload(f"{name!r} is no name of a member")
    path = folder / name
    if path.is_symlink() or not path.is_file():
        raise BadPayload(f"the member {name} is missing")
    if path.stat().st_size != size or _digest(path) != digest:
        raise BadPayload(f"the member {name} is not what was written")


def _listed(name: str, members: dict[str, Any]) -> str:
    if name not in members:
        raise BadPayload(f"the member {name} is not listed")
    return name


def _read_leaf(folder: Path, name: str) -> Any:
    data = (folder / name).read_bytes()
    if name.endswith(".txt"):
        return data.decode("utf-8")
    if name.endswith(".bin"):
        return data
    try:
        return np.load(io.BytesIO(data), allow_pickle=False)
    except (ValueError, EOFError) as error:
        raise BadPayload(f"the member {name} is no array ({error})") from None


def _digest(path: Path) -> str:
    hasher = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(_HASHED_AT_ONCE):
            hasher.update(block)
    return hasher.hexdigest()
