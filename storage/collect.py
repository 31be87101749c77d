"""Free room: forget what the policy lets go, and remove the objects that nothing needs.

The order is that of ``INVARIANTS.md``: while no name is being made, actions go first and for
good, then the objects that no action gives, each by one rename; their bytes are freed when
the store is open to writers again. A bucket holds no writers off: there objects are safe by
their age, what was recorded meanwhile is looked at again before each step, and what was
recorded nevertheless is forgotten again, so that it is a miss and no dangling action.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass

from storage import actions
from storage.expire import expire
from storage.forget import use_name
from storage.keep import GRACE_S, Choice, Held, Keep, choose
from storage.ledger import Entry, Ledger
from storage.medium import Medium
from storage.objects import MANIFEST
from storage.roots import held

_BATCH = 1000


@dataclass(frozen=True)
class Forgotten:
    """An action that a collection has forgotten, or would."""

    key: str
    scene: str
    step: str
    label: str
    bytes: int
    used: float
    why: str


@dataclass(frozen=True)
class Collected:
    """What a collection did, or with ``dry_run`` would do."""

    forgotten: tuple[Forgotten, ...]
    objects: int
    freed_bytes: int
    bytes_left: int
    leftovers: int
    dry_run: bool


def collect(
    medium: Medium,
    keep: Keep,
    *,
    quota_bytes: int | None = None,
    grace_s: float = GRACE_S,
    dry_run: bool = False,
    now: float | None = None,
) -> Collected:
    """Collect. ``now`` is in Unix seconds; the arguments are those of ``Store.collect``."""
    collection = _Collection(medium, keep, quota_bytes, grace_s, now or time.time())
    if dry_run:
        return collection.preview()
    leftovers = medium.sweep()
    collection.explain()
    with medium.collecting():
        choice, freed, total = collection.collect()
    medium.sweep()
    leftovers += expire(medium, keep.evidence_s, collection.now)
    return _result(choice, freed, total, leftovers, dry_run=False)


@dataclass
class _Collection:
    medium: Medium
    keep: Keep
    quota_bytes: int | None
    grace_s: float
    now: float

    def __post_init__(self) -> None:
        self.ledger = Ledger(self.medium)

    def preview(self) -> Collected:
        choice, dead, sizes = self._choose()
        old = {digest: sizes[digest] for digest in dead if self._is_old(digest)}
        return _result(choice, old, sum(sizes.values()), 0, dry_run=True)

    def explain(self) -> None:
        """Keep what is known of what will be forgotten; on a full disk, what there is room for."""
        for entry, _why in self._choose()[0].forgotten:
            record = self.ledger.record(entry)
            with suppress(OSError):
                if record is not None:
                    actions.keep_for_explanations(self.medium, record)

    def collect(self) -> tuple[Choice, dict[str, int], int]:
        """Forget and remove, while no name is being made.

        Returns what was forgotten, the bytes of what was removed, and of all there was.
        """
        self.ledger.refresh()
        choice, dead, sizes = self._choose()
        self._delete(entry for entry, _why in choice.forgotten)
        self.ledger.refresh()
        removed: dict[str, int] = {}
        for batch in _batches([digest for digest in dead if not self.ledger.gives(digest)]):
            old = [digest for digest in batch if self._is_old(digest)]
            self.medium.remove(*old)
            removed |= {digest: sizes[digest] for digest in old}
        self.ledger.refresh()
        self._delete(entry for entry in self.ledger if not removed.keys().isdisjoint(entry.objects))
        return choice, removed, sum(sizes.values())

    def _delete(self, entries: Iterable[Entry]) -> None:
        names = [name for entry in entries for name in (entry.name, use_name(entry.key))]
        if names:
            self.medium.delete(*names)

    def _choose(self) -> tuple[Choice, list[str], dict[str, int]]:
        """Return what to forget, the objects that no action gives then, and all known sizes."""
        roots = held(self.medium)
        sizes = self.ledger.live_objects()
        orphans = [digest for digest in self.medium.objects() if digest not in sizes]
        sizes |= {digest: self._size(digest) for digest in orphans}
        old = [d for d in orphans if d not in roots.digests and self._is_old(d)]
        young_bytes = sum(sizes[d] for d in orphans) - sum(sizes[d] for d in old)
        choice = choose(
            self.ledger,
            roots,
            self.keep,
            now=self.now,
            grace_s=self.grace_s,
            quota_bytes=self.quota_bytes,
            other_bytes=young_bytes,
        )
        return choice, old + self._bereft(choice, roots), sizes

    def _bereft(self, choice: Choice, roots: Held) -> list[str]:
        """Return the objects that only what is forgotten gave."""
        gone = {entry.key for entry, _why in choice.forgotten}
        still = {d for entry in self.ledger if entry.key not in gone for d in entry.objects}
        lost = {d for entry, _why in choice.forgotten for d in entry.objects}
        return sorted(lost - still - roots.digests)

    def _is_old(self, digest: str) -> bool:
        try:
            return self.now - self.medium.published_at(digest) > self.keep.unrecorded_s
        except FileNotFoundError:
            return False  # gone, or none: repair deals with that

    def _size(self, digest: str) -> int:
        sizes = self.medium.members(digest)
        return sum(sizes.values()) - sizes.get(MANIFEST, 0)


def _batches(digests: list[str]) -> Iterator[list[str]]:
    """Give so few at a time that their age is still true when they go."""
    for start in range(0, len(digests), _BATCH):
        yield digests[start : start + _BATCH]


def _result(
    choice: Choice, dead: dict[str, int], total: int, leftovers: int, *, dry_run: bool
) -> Collected:
    forgotten = tuple(
        Forgotten(e.key, e.scene, e.step, e.label, sum(e.objects.values()), e.used, why)
        for e, why in choice.forgotten
    )
    freed = sum(dead.values())
    return Collected(forgotten, len(dead), freed, total - freed, leftovers, dry_run)
