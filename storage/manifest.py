"""Seal an object: its manifest lists every member's size and digest.

The manifest's own digest is the object's name, so it holds no time, host or path.
"""

from __future__ import annotations

import json
from dataclasses import dataclass

from storage.digest import digest_bytes
from storage.errors import StoreFormatError

MANIFEST = "manifest.json"
FORMAT = 1


@dataclass(frozen=True)
class Member:
    """One file of an object."""

    size: int  # bytes
    digest: str


@dataclass(frozen=True)
class Manifest:
    """What an object holds. ``content`` is the digest of the logical value."""

    kind: str
    schema: str
    content: str
    members: dict[str, Member]

    @property
    def size(self) -> int:
        """Bytes of all members."""
        return sum(member.size for member in self.members.values())

    def to_bytes(self) -> bytes:
        """Return the one way to write this manifest."""
        document = {
            "content": self.content,
            "format": FORMAT,
            "kind": self.kind,
            "members": {
                path: [member.size, member.digest] for path, member in self.members.items()
            },
            "schema": self.schema,
        }
        return json.dumps(
            document, sort_keys=True, separators=(",", ":"), ensure_ascii=False
        ).encode()

    @property
    def digest(self) -> str:
        """The object's digest."""
        return digest_bytes(self.to_bytes())

    @classmethod
    def from_bytes(cls, data: bytes) -> Manifest:
        """Read a manifest; StoreFormatError if it is none or lists an unsafe path."""
        try:
            document = json.loads(data)
            if document["format"] != FORMAT:
                raise StoreFormatError(f"manifest of unknown format {document['format']}")
            members = {
                _safe(path): Member(int(size), str(digest))
                for path, (size, digest) in document["members"].items()
            }
            return cls(document["kind"], document["schema"], document["content"], members)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise StoreFormatError(f"unreadable manifest: {error}") from error


def _safe(path: str) -> str:
    if any(part in ("", ".", "..") for part in path.split("/")):
        raise StoreFormatError(f"manifest member {path!r} would leave its object")
    return path
