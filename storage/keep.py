"""Decide what a collection forgets: a pure function of what is there, is held and was used."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

from storage.ledger import Entry

GRACE_S = 24 * 3600.0


@dataclass(frozen=True)
class Keep:
    """What a collection keeps besides pins, leases and what is in use.

    Args:
        unused_s: an action without a hit for so long is forgotten; None keeps it.
        last: that many newest actions of each scene's step stay however long they are unused.
        unrecorded_s: an object younger than this may still get its action.
        evidence_s: conflicts, quarantine and what is known of forgotten actions stay so long.
    """

    unused_s: float | None = None
    last: int = 1
    unrecorded_s: float = 2 * 3600.0
    evidence_s: float = 90 * 24 * 3600.0


@dataclass(frozen=True)
class Held:
    """What must not be forgotten: digests (keys, objects, contents) and whole scenes."""

    digests: frozenset[str] = frozenset()
    scenes: frozenset[str] = frozenset()

    def holds(self, entry: Entry) -> bool:
        """Tell whether an action must stay."""
        if entry.scene in self.scenes or entry.key in self.digests:
            return True
        return any(d in self.digests for d in (*entry.objects, *entry.contents))


@dataclass(frozen=True)
class Choice:
    """What is forgotten and why, and the bytes of the objects that stay."""

    forgotten: tuple[tuple[Entry, str], ...]
    bytes_left: int


def choose(
    entries: Iterable[Entry],
    held: Held,
    keep: Keep,
    *,
    now: float,
    grace_s: float,
    quota_bytes: int | None = None,
    other_bytes: int = 0,
) -> Choice:
    """Choose what to forget: first what nobody has used for too long, then for the quota.

    For the quota the longest unused goes first; the newest of each scene's step only when
    nothing else is left. What was used within ``grace_s`` seconds stays in any case.

    Args:
        entries: all actions.
        held: what stays whatever the policy.
        keep: the policy.
        now: Unix seconds.
        grace_s: seconds.
        quota_bytes: what all objects together may take.
        other_bytes: what objects without an action take.
    """
    known = list(entries)
    newest = _newest(known, keep.last)
    users = Counter(digest for entry in known for digest in entry.objects)
    sizes = {digest: size for entry in known for digest, size in entry.objects.items()}
    left = sum(sizes.values()) + other_bytes
    forgotten: list[tuple[Entry, str]] = []
    free = [e for e in known if now - e.used > grace_s and not held.holds(e)]
    for entry in sorted(free, key=lambda e: (e.key in newest, e.used, e.key)):
        idle = now - entry.used
        if keep.unused_s is not None and idle > keep.unused_s and entry.key not in newest:
            reason = f"unused for {idle / 86400:.1f} days"
        elif quota_bytes is not None and left > quota_bytes:
            reason = "to come under the quota"
        else:
            continue
        forgotten.append((entry, reason))
        for digest in entry.objects:
            users[digest] -= 1
            if users[digest] == 0 and digest not in held.digests:
                left -= sizes[digest]
    return Choice(tuple(forgotten), left)


def _newest(entries: Iterable[Entry], last: int) -> set[str]:
    groups: dict[tuple[str, str, str], list[Entry]] = defaultdict(list)
    for entry in entries:
        groups[entry.scene, entry.step, entry.label].append(entry)
    return {
        entry.key
        for group in groups.values()
        for entry in sorted(group, key=lambda e: e.started, reverse=True)[:last]
    }
