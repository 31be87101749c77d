"""Open a store, publish into it, look up and read from it.

What a store promises and how it is laid out stands in ``INVARIANTS.md``.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from storage import actions, objects, pins
from storage.actions import ActionRecord, action_name
from storage.address import find_medium
from storage.check import Problem, action_problems, check_store
from storage.errors import (
    CorruptArtifact,
    MissingArtifact,
    StoreError,
    StoreFormatError,
    StoreFull,
    StoreMissing,
)
from storage.folder import FolderMedium
from storage.forget import forget, quarantine, use_name
from storage.keep import GRACE_S, Keep
from storage.leases import LEASE_S, Lease, LeaseTable
from storage.manifest import Manifest
from storage.medium import Level, Medium
from storage.members import MemberReader
from storage.objects import Published
from storage.owner import Owner
from storage.pins import Pin
from storage.quota import Quota, configured_quota
from storage.search import matches

if TYPE_CHECKING:
    from storage.collect import Collected
    from storage.repair import Repaired

FORMAT = 1
HASH = "blake3-256"
_KNOWN = {"format": FORMAT, "hash": HASH}
MARKER = "store.json"
_NEW_S = 3600.0
"""A record says itself that it was in use when it was made: so long its uses leave no mark."""

T = TypeVar("T")


class Store:
    """An artifact store in a folder or a bucket. Safe for many threads and processes at once."""

    def __init__(
        self, medium: Medium, *, verify: Level = "manifest", quota_bytes: int | None = None
    ) -> None:
        self.medium = medium
        self.verify_level: Level = verify
        self._quota = None if quota_bytes is None else Quota(medium, quota_bytes)

    @classmethod
    def open(
        cls,
        address: str | Path,
        *,
        create: bool = True,
        durability: Literal["full", "none"] = "full",
        verify: Level = "manifest",
        lease_s: float = LEASE_S,
        quota_bytes: int | None = None,
    ) -> Store:
        """Open the store at ``address``; make a new one there if ``create``.

        Args:
            address: the store's folder, or ``s3://BUCKET/PREFIX``.
            create: whether to make a new store if there is none.
            durability: ``none`` skips fsync (for tests).
            verify: how thoroughly a hit is checked before it counts.
            lease_s: seconds after which a lease that is not renewed ends.
            quota_bytes: what its objects may take (default: ``$GARDEN_STORE_QUOTA``, else
                no limit); see ``make_room``.

        Raises:
            StoreMissing: there is none and ``create`` is False, or there is no such bucket.
            StoreFormatError: the place holds something else, or an unknown format.
            StoreDenied: the bucket's server refuses the credentials.
            StoreFull, StoreReadOnly: it cannot be made there.
        """
        medium = find_medium(address, durable=durability == "full", lease_s=lease_s)
        quota = configured_quota() if quota_bytes is None else quota_bytes
        store = cls(medium, verify=verify, quota_bytes=quota)
        marker = store._marker()
        if marker is None:
            if not create:
                raise StoreMissing(
                    f"there is no store at {medium.address}: give its folder or bucket with"
                    " --store or GARDEN_STORE"
                )
            with store._explained():
                medium.prepare()
                medium.create(MARKER, json.dumps(_KNOWN, sort_keys=True).encode())
            marker = store._marker()
        store._check_format(marker)
        return store

    @property
    def address(self) -> str:
        """How a user, or another process, names this store."""
        return self.medium.address

    @property
    def path(self) -> Path:
        """The store's folder; StoreError for a store in a bucket."""
        return self._folder_medium().path

    @property
    def durable(self) -> bool:
        """Whether what is published is synchronised to the disk before it counts."""
        return getattr(self.medium, "durable", True)

    @property
    def leases(self) -> LeaseTable:
        """Who computes which key."""
        return self.medium.leases

    def _folder_medium(self) -> FolderMedium:
        if not isinstance(self.medium, FolderMedium):
            raise StoreError(f"the store {self.address} is not in a folder")
        return self.medium

    def _marker(self) -> bytes | None:
        try:
            return self.medium.read(MARKER)
        except (ConnectionError, TimeoutError):
            raise
        except OSError as error:
            raise StoreFormatError(f"{self.address}/{MARKER} cannot be read: {error}") from error

    def _check_format(self, marker: bytes | None) -> None:
        try:
            document = json.loads(marker or b"")
        except ValueError as error:
            raise StoreFormatError(f"{self.address}/{MARKER} cannot be read: {error}") from error
        if document != _KNOWN:
            raise StoreFormatError(
                f"the store {self.address} is of format {document}, this version knows only"
                f" format {FORMAT} with {HASH}: use the version that made it, or another store"
            )

    # -- publishing -----------------------------------------------------------------------

    def publish(self, value: object) -> Published:
        """Publish ``value`` as an object; a no-op if an equal object is there and whole.

        Raises:
            Unstorable: the value has a part that cannot be stored.
            StoreFull, StoreReadOnly: nothing was published.
        """
        from storage.codec.values import write_value

        with self._explained(), self.medium.stage() as staged:
            manifest = write_value(value, staged)
            staged.sync()
            with self.medium.publishing():
                published = objects.seal(self.medium, staged, manifest)
        if self._quota is not None:
            self._quota.add(published.bytes)
        return published

    def make_room(self) -> None:
        """Before a step begins: collect what may go if the store has come near its quota.

        Raises:
            StoreFull: it is at its quota, and nothing more may be forgotten.
        """
        if self._quota is not None:
            with self._explained():
                self._quota.make_room()

    def record(self, record: ActionRecord) -> ActionRecord:
        """Publish an action record; return the one that counts (the first of its key).

        Raises:
            MissingArtifact, CorruptArtifact: an output is not in the store, so that the
                record would dangle.
            StoreFull, StoreReadOnly: nothing was recorded.
        """
        with self._explained(), self.medium.publishing():
            for output in record.outputs.values():
                objects.verify(self.medium, output.object, "manifest")
            return actions.create_action(self.medium, record)

    def remember_latest(self, record: ActionRecord, scene: str, label: str) -> None:
        """Note that (scene, step, label) now stands on ``record``, for later explanations.

        A store that cannot be written to still serves hits: then nothing is noted.
        """
        if actions.latest_key(self.medium, scene, record.step, label) == record.key:
            return
        try:
            actions.point_to_latest(
                self.medium, scene=scene, step=record.step, label=label, key=record.key
            )
        except OSError:
            return

    def acquire(self, key: str) -> Lease | None:
        """Return the lease to compute ``key``, or None while somebody else holds it."""
        with self._explained():
            return self.leases.try_acquire(key)

    # -- looking up and reading -----------------------------------------------------------

    def lookup(self, key: str, *, mend: bool = True) -> tuple[ActionRecord | None, str]:
        """Return the verified record of a key, or None and why it does not count.

        The reason is ``hit``, ``absent``, ``evicted`` (its object is gone) or ``corrupt``.
        With ``mend`` a damaged object is put into quarantine and its actions are forgotten;
        without, nothing is changed.
        """
        record = actions.read_action(self.medium, key)
        if record is None:
            return None, "absent"
        for output in record.outputs.values():
            try:
                objects.verify(self.medium, output.object, self.verify_level)
            except MissingArtifact:
                if mend:
                    self._forget_dangling(record)
                return None, "evicted"
            except CorruptArtifact:
                if mend:
                    self.discard(output.object)
                return None, "corrupt"
        if mend and time.time() - record.started > _NEW_S:
            self.medium.touch(use_name(key))
        return record, "hit"

    def read(self, object_digest: str, expected: type[T]) -> T:
        """Return the value of an object, verified.

        Raises:
            MissingArtifact, CorruptArtifact: see ``discard`` for the latter.
            SchemaMismatch: it is no ``expected``.
        """
        value: T = self._reader(object_digest).value(expected)
        return value

    def read_as(self, object_digest: str, hint: object) -> Any:
        """Return the value of an object as a type hint describes it."""
        return self._reader(object_digest).value(hint)

    def read_fields(
        self, object_digest: str, expected: type, names: tuple[str, ...]
    ) -> dict[str, Any]:
        """Return some fields of an object without touching the others."""
        return self._reader(object_digest).fields(expected, names)

    def read_array(self, object_digest: str, path: str) -> tuple[Any, tuple[int, ...]]:
        """Return a Zarr array to slice and where the leaf at ``path`` lies in it."""
        return self._reader(object_digest).array(path)

    def manifest(self, object_digest: str) -> Manifest:
        """Return an object's manifest."""
        return objects.read_manifest(self.medium, object_digest)

    def folder(self, object_digest: str) -> Path:
        """Return the folder of an object, which is a Zarr group; read it only."""
        return self._folder_medium().folder(object_digest)

    def discard(self, object_digest: str) -> None:
        """Put a damaged object into quarantine; every action that gave it is forgotten first."""
        with self._explained():
            quarantine(self.medium, object_digest)

    def _forget_dangling(self, record: ActionRecord) -> None:
        """Forget an action without its objects, unless it has them again by now."""
        with self._explained(), self.medium.collecting():
            now = actions.read_action(self.medium, record.key)
            if now is not None and action_problems(self.medium, action_name(record.key), set()):
                forget(self.medium, [now])

    def _reader(self, object_digest: str) -> Any:
        from storage.codec.values import ValueReader

        manifest = objects.verify(self.medium, object_digest, self.verify_level)
        return ValueReader(MemberReader(self.medium, object_digest, manifest))

    # -- listing and checking -------------------------------------------------------------

    def actions(self) -> Iterator[ActionRecord]:
        """Give every action record, the newest last."""
        yield from sorted(actions.all_actions(self.medium), key=lambda record: record.started)

    def action(self, key: str) -> ActionRecord | None:
        """Return the record of a key, unverified."""
        return actions.read_action(self.medium, key)

    def latest(self, scene: str, step: str, label: str = "") -> ActionRecord | None:
        """Return the newest action of a scene's step, for explanations: it may be collected."""
        return actions.latest_record(self.medium, scene, step, label)

    def has_run(self, scene: str, step: str, label: str = "") -> bool:
        """Tell whether a scene's step has run, whatever is left of it."""
        return actions.latest_key(self.medium, scene, step, label) is not None

    def latest_of_scene(self, scene: str) -> Iterator[tuple[str, str, ActionRecord]]:
        """Give (step, label, newest record) of all that ran for ``scene``."""
        for step, label, key in actions.latest_of_scene(self.medium, scene):
            record = actions.read_action(self.medium, key)
            if record is not None:
                yield step, label, record

    def find(self, text: str) -> list[ActionRecord]:
        """Return the actions that ``text`` names (``storage.search``), the newest last."""
        from storage.catalogue import read_columns

        columns = ("key", "scene", "step", "label", "object", "content")
        keys = (row[0] for row in read_columns(self.medium, *columns) if matches(text, *row))
        found = (actions.read_action(self.medium, key) for key in dict.fromkeys(keys))
        return [record for record in found if record is not None]

    def makers(self) -> dict[str, str]:
        """Return the key of the newest action that gave each content."""
        from storage.catalogue import read_columns

        return dict(read_columns(self.medium, "content", "key"))

    def remembered(self, scene: str) -> Iterator[ActionRecord]:
        """Give the actions of a scene's steps that were forgotten but are still explained."""
        return actions.remembered(self.medium, scene)

    def conflicts(self) -> Iterator[ActionRecord]:
        """Give every record that came second for its key with another result."""
        return actions.all_conflicts(self.medium)

    def objects(self) -> Iterator[tuple[str, int]]:
        """Give every object's digest and the bytes of its members."""
        for digest in self.medium.objects():
            try:
                yield digest, objects.read_manifest(self.medium, digest).size
            except (CorruptArtifact, MissingArtifact):
                yield digest, 0

    def size(self) -> int:
        """Return the bytes of all objects."""
        return sum(size for _digest, size in self.objects())

    def verify(self, level: Level = "full") -> list[Problem]:
        """Check every object and every action; change nothing."""
        return check_store(self.medium, level)

    def repair(self, level: Level = "full") -> list[Repaired]:
        """Bring the store back to its invariants; damaged things go to quarantine.

        Raises:
            StoreFull, StoreReadOnly: it could not be done, or not all of it.
        """
        from storage.repair import repair

        with self._explained():
            return repair(self.medium, level)

    def catalogue(self) -> Any:
        """Return a ``pyarrow.Table`` of all actions (``storage.catalogue.COLUMNS``)."""
        from storage.catalogue import read_catalogue

        return read_catalogue(self.medium)

    def compact(self) -> int:
        """Write the catalogue anew, as one file; return its rows."""
        from storage.catalogue import compact

        with self._explained():
            return compact(self.medium)

    # -- keeping and letting go -----------------------------------------------------------

    def pin(
        self,
        name: str,
        digests: Iterable[str] = (),
        *,
        scenes: Iterable[str] = (),
        reason: str = "",
        for_s: float | None = None,
    ) -> Pin:
        """Hold keys, objects or contents, and all of some scenes, against collection.

        Args:
            name: a plain word, not in use.
            digests: whole digests of keys, objects or contents.
            scenes: names of scenes; what is made for them later is held too.
            reason: for people.
            for_s: hold it for this process only, and at most so many seconds.

        Raises:
            StoreError: the name is taken or no plain word, or a digest is none.
        """
        pin = Pin(
            name,
            tuple(digests),
            tuple(scenes),
            reason,
            created=time.time(),
            owner=None if for_s is None else Owner.here(),
            expires_at=None if for_s is None else time.time() + for_s,
        )
        with self._explained(), self.medium.publishing():
            pins.create_pin(self.medium, pin)
        return pin

    def unpin(self, name: str) -> bool:
        """Let go of what a pin held; False if there is none of this name."""
        with self._explained():
            return pins.delete_pin(self.medium, name)

    def pins(self) -> list[Pin]:
        """Return the pins that hold something, by name; StoreError if one cannot be read."""
        return list(pins.all_pins(self.medium))

    def collect(
        self,
        *,
        quota_bytes: int | None = None,
        grace_s: float = GRACE_S,
        keep: Keep = Keep(),
        dry_run: bool = False,
    ) -> Collected:
        """Remove what no action needs, and forget actions by policy (``storage.keep``).

        Args:
            quota_bytes: what all objects may take; the longest unused go first.
            grace_s: what was made or used within so many seconds stays.
            keep: what else stays.
            dry_run: only tell.

        Raises:
            StoreError: a pin cannot be read.
            StoreReadOnly, StoreFull: nothing could be changed.
        """
        from storage.collect import collect

        with self._explained():
            return collect(
                self.medium, keep, quota_bytes=quota_bytes, grace_s=grace_s, dry_run=dry_run
            )

    # -- room to work in ------------------------------------------------------------------

    @contextmanager
    def scratch(self) -> Iterator[Path]:
        """Give a folder on this machine for libraries that need files; then remove it."""
        try:
            with self.medium.scratch() as folder:
                yield folder
        except OSError as error:
            explained = self.medium.explain(error)
            if isinstance(explained, StoreFull):  # other errors may be the library's own
                raise explained from error
            raise

    @contextmanager
    def _explained(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            explained = self.medium.explain(error)
            if explained is None:
                raise
            raise explained from error
