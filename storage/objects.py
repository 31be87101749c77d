"""Publish and verify objects: members sealed by a manifest.

An object is seen under its final name only when it is whole and durable (invariants
SEALED, SELF-NAMING, WRITE-ONCE).
"""

from __future__ import annotations

from dataclasses import dataclass

from storage.digest import digest_bytes
from storage.errors import CorruptArtifact, MissingArtifact, StoreFormatError
from storage.forget import quarantine
from storage.manifest import MANIFEST, Manifest
from storage.medium import Level, Medium
from storage.members import MemberWriter


@dataclass(frozen=True)
class Published:
    """An object in the store. ``content`` is the digest of the value that it holds."""

    object: str
    content: str
    kind: str
    bytes: int


def seal(medium: Medium, staged: MemberWriter, manifest: Manifest) -> Published:
    """Publish the staged members under the manifest's digest.

    If the object is already there and whole, the staged copy is dropped; if what stands
    there is damaged, it goes to quarantine and the staged copy takes its place.
    """
    data = manifest.to_bytes()
    digest = digest_bytes(data)
    if _is_whole(medium, digest):
        medium.refresh(digest, data)
    elif not medium.seal(staged, digest, data):
        verify(medium, digest, medium.recheck)  # somebody was faster
    return Published(digest, manifest.content, manifest.kind, manifest.size)


def _is_whole(medium: Medium, digest: str) -> bool:
    try:
        verify(medium, digest, medium.recheck)
    except MissingArtifact:
        return False
    except CorruptArtifact:
        quarantine(medium, digest)
        return False
    return True


def read_manifest(medium: Medium, digest: str) -> Manifest:
    """Return an object's manifest, checked against the object's name.

    Raises:
        MissingArtifact: there is no such object.
        CorruptArtifact: the manifest is not the one that was published.
    """
    try:
        data = medium.read_member(digest, MANIFEST)
    except FileNotFoundError:
        if medium.members(digest):
            raise CorruptArtifact(digest, "its manifest is missing") from None
        raise MissingArtifact(
            f"artifact {digest[:15]} is not in the store {medium.address}"
        ) from None
    except (ConnectionError, TimeoutError):
        raise
    except OSError as error:
        raise CorruptArtifact(digest, f"its manifest cannot be read ({error})") from error
    if digest_bytes(data) != digest:
        raise CorruptArtifact(digest, "its manifest has changed")
    try:
        return Manifest.from_bytes(data)
    except StoreFormatError as error:
        raise CorruptArtifact(digest, str(error)) from error


def verify(medium: Medium, digest: str, level: Level) -> Manifest:
    """Check an object and return its manifest.

    ``manifest`` compares the set of members and their sizes, ``full`` hashes them too.

    Raises:
        MissingArtifact, CorruptArtifact: see ``read_manifest``.
    """
    manifest = read_manifest(medium, digest)
    present = medium.members(digest)
    present.pop(MANIFEST, None)
    if present != {path: member.size for path, member in manifest.members.items()}:
        raise CorruptArtifact(digest, _difference(manifest, present))
    if level == "full":
        for path, member in manifest.members.items():
            if medium.member_digest(digest, path) != member.digest:
                raise CorruptArtifact(digest, f"member {path} has changed")
    return manifest


def _difference(manifest: Manifest, present: dict[str, int]) -> str:
    if missing := sorted(manifest.members.keys() - present.keys()):
        return f"member {missing[0]} is missing"
    if extra := sorted(present.keys() - manifest.members.keys()):
        return f"{extra[0]} is no member"
    path, member = next((p, m) for p, m in manifest.members.items() if present[p] != m.size)
    return f"member {path} has {present[path]} bytes instead of {member.size}"
