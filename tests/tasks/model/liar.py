"""A worker that does not keep to the protocol: ``PYTHON liar.py HOW [what start.py gets]``.

It needs nothing but the standard library.
"""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path
from typing import Any


def say(message: Any) -> None:
    text = message if isinstance(message, str) else json.dumps(message)
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def hear() -> Any:
    return json.loads(sys.stdin.readline())


def answer(folder: Path, how: str) -> str:
    """Write an answer of which something is wrong; return the digest that is told."""
    folder.mkdir()
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (3, 2), }".ljust(117) + b"\n"
    data = b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + bytes(48)
    if how == "no array":
        data = data[:9]
    (folder / "0000.npy").write_bytes(data)
    digest = hashlib.sha256(data).hexdigest()
    members: dict[str, Any] = {"0000.npy": [len(data), digest]}
    leaves = {"values": "0000.npy"}
    tree: Any = {
        "$type": "Answer",
        "fields": {"values": {"$leaf": "values"}, "noise": 0.0, "parts": {"$tuple": []}},
    }
    if how == "missing member":
        (folder / "0000.npy").unlink()
    elif how == "unlisted member":
        members = {}
    elif how == "changed member":
        (folder / "0000.npy").write_bytes(data[::-1])
    elif how == "member outside":
        members = {"../../secret": [len(data), digest]}
    elif how == "linked member":
        (folder / "0000.npy").unlink()
        (folder / "0000.npy").symlink_to("/etc/passwd")
    elif how == "missing field":
        del tree["fields"]["noise"]
    elif how == "other noun":
        tree["$type"] = "Part"
    elif how == "no tree":
        tree = 7
    document = {
        "format": "garden.payload/9" if how == "other payload" else "garden.payload/1",
        "tree": tree,
        "leaves": leaves,
        "members": members,
    }
    text = json.dumps(document).encode()
    (folder / "tree.json").write_bytes(text)
    return "0" * 64 if how == "other digest" else hashlib.sha256(text).hexdigest()


def main() -> None:
    how = sys.argv[1]
    if how == "silent":
        sys.stdin.readline()
    version = "garden.worker/99" if how == "version" else "garden.worker/1"
    say("hello, I am a program" if how == "greeting" else {"hello": {"protocol": version}})
    hear()
    say({"progress": ["a third", 3]} if how == "progress" else {"progress": [0.5, "loading"]})
    loaded = float("nan") if how == "no number loaded" else 0.1
    say([1, 2] if how == "list" else {"loaded": {"seconds": loaded}})
    asked = hear()["ask"]
    if how == "flood":
        sys.stdout.write("x" * (9 << 20))
        sys.stdout.flush()
    if how == "garbage":
        say("Segmentation fault (not really)")
    if how == "unknown word":
        say({"maybe": {}})
    if how == "bad error":
        say({"error": "it went wrong"})
    seconds = "a while" if how == "no number" else 0.1
    number = asked["id"] + 5 if how == "other question" else asked["id"]
    digest = answer(Path(asked["folder"]) / "answer", how)
    say({"answer": {"id": number, "digest": digest, "seconds": seconds}})
    hear()


if __name__ == "__main__":
    main()
