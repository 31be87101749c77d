"""Fail, die or lose power at any single call to the disk of a deed; then look and do it again."""

from __future__ import annotations

import errno
import shutil
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from storage import Keep, Store, StoreError
from tests.faults.part import Count, part
from tests.storage.faulty import FaultyOs, Killed, disk
from tests.storage.history import did, key_of, value
from tests.storage.test_repair import flip, garble_action, lose_manifest, lose_object
from tests.storage.test_store import record_of

State = tuple[object, ...]
HOW = {
    "kill": ("kill", 0),
    "power": ("power", 0),
    "torn power": ("torn", 0),
    "full disk": ("error", errno.ENOSPC),
    "I/O error": ("error", errno.EIO),
}


@dataclass(frozen=True)
class Deed:
    """Something that changes a store which ``prepare`` made.

    ``damaged`` deeds begin on a store with damage: there it is no violation, and results
    whose scene is ``good`` must survive.
    """

    name: str
    prepare: Callable[[Store], object]
    act: Callable[[Store], object]
    damaged: bool = False


def nothing(store: Store) -> None:
    """Begin with an empty store."""


def publish(store: Store) -> None:
    """What a step does. A lease that an earlier trial left is of a process that lives: this."""
    lease = store.acquire(key_of("k"))
    record = store.record(record_of(store, value(1)))
    store.remember_latest(record, "kitchen", "bulldozer")
    if lease is not None:
        store.leases.release(lease)


def some_past(store: Store) -> None:
    """Results to keep and to forget, a shared object, orphans, a pin and a conflict."""
    for days in (2, 3, 4):
        did(store, f"old{days}", days, days_ago=days, label=str(days))
    did(store, "shares", 4, days_ago=0, scene="good")
    did(store, "pinned", 9, days_ago=9, scene="good")
    store.pin("held", scenes=["good"])
    store.publish(value(20))
    first = did(store, "twice", 5, days_ago=5)
    store.record(record_of(store, value(6), key=first.key))


def collect(store: Store) -> None:
    store.collect(quota_bytes=0, grace_s=0.0, keep=Keep(unrecorded_s=-1.0))


def some_damage(store: Store) -> None:
    for number, damage in enumerate((flip, lose_manifest, lose_object, garble_action)):
        damage(store, did(store, damage.__name__, number))
    did(store, "good", 30, scene="good")
    (store.path / "trash" / "x").mkdir(parents=True)


def damaged_object(store: Store) -> None:
    flip(store, did(store, "again", 1))
    did(store, "good", 30, scene="good")


def pin_and_compact(store: Store) -> None:
    for name in ("held", "too"):
        store.unpin(name)
        store.pin(name, scenes=["good"])
    store.compact()


DEEDS = (
    Deed("publish", nothing, publish),
    Deed("publish over damage", damaged_object, publish, damaged=True),
    Deed("collect", some_past, collect),
    Deed("repair", some_damage, Store.repair, damaged=True),
    Deed("pin and compact", some_past, pin_and_compact),
)


def state(store: Store) -> State:
    """Return what counts of a store: results, objects, pins."""
    contents = sorted((r.key, r.outputs["value"].content) for r in store.actions())
    return contents, sorted(store.medium.objects()), [pin.scenes for pin in store.pins()]


class Trials:
    """All ways to disturb one deed, in a folder of its own."""

    def __init__(self, deed: Deed, folder: Path) -> None:
        self.deed = deed
        self._template, self._place = folder / "template", folder / "store"
        deed.prepare(Store.open(self._template, durability="none"))
        store = self._fresh()
        with disk(FaultyOs()) as counted:
            self.deed.act(store)
        self.operations = list(counted.operations)
        self.expected = state(self._open())

    def run(self, at: int, how: str) -> list[str]:
        """Disturb the call number ``at``; return every violation."""
        kind, code = HOW[how]
        store = self._fresh()
        completed = False
        with disk(FaultyOs(at, kind, code)):
            try:
                self.deed.act(store)
                completed = True
            except (Killed, OSError, StoreError):
                pass
            finally:
                store.leases.abandon_all()
        where = f"{how} at call {at} ({self.operations[min(at, len(self.operations) - 1)]})"
        return [f"{where}: {violation}" for violation in self._violations(completed)]

    def _violations(self, completed: bool) -> Iterator[str]:
        store = self._open()
        if completed and state(store) != self.expected:
            yield "it said that it was done, and was not"
        problems = store.verify("full")
        if not self.deed.damaged:
            yield from map(str, problems)
        for record in store.actions():
            served = store.lookup(record.key, mend=False)[1]
            if served != "hit" and (record.scene == "good" or not self.deed.damaged):
                yield f"{record.key[:15]} is {served}"
        try:
            self.deed.act(store)
        except (OSError, StoreError) as error:
            yield f"doing it again failed: {error}"
            return
        finally:
            store.leases.abandon_all()
        yield from (f"after doing it again: {problem}" for problem in store.verify("full"))
        if state(store) != self.expected:
            yield f"doing it again gave {state(store)} instead of {self.expected}"

    def _fresh(self) -> Store:
        """Return a copy of the store as it was before the deed, writing with all fsyncs."""
        shutil.rmtree(self._place, ignore_errors=True)
        shutil.copytree(self._template, self._place)
        return Store.open(self._place)

    def _open(self) -> Store:
        return Store.open(self._place, durability="none")


def disturb(trials: Trials, how: str, calls: Iterable[int]) -> list[Count]:
    """Disturb the calls in one way; count by operation."""
    done: Counter[str] = Counter()
    violations: dict[str, list[str]] = {}
    for at in calls:
        operation = trials.operations[at]
        done[operation] += 1
        violations.setdefault(operation, []).extend(trials.run(at, how))
    return [Count(f"{how} at {op}", n, tuple(violations[op])) for op, n in sorted(done.items())]


def _whole(deed: Deed) -> Callable[[Path], Iterator[Count]]:
    def run(folder: Path) -> Iterator[Count]:
        trials = Trials(deed, folder)
        for how in HOW:
            yield from disturb(trials, how, range(len(trials.operations)))

    return run


for _deed in DEEDS:
    part(_deed.name)(_whole(_deed))
