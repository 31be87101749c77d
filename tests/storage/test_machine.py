"""NO-DANGLING, SEALED, SELF-NAMING under any order of deeds: a store beside a plain model.

The model knows which key has which content, what is pinned and leased, and when each key was
made or last used. Whatever hypothesis does, the store must agree with it.
"""

from __future__ import annotations

import os
import shutil
import tempfile
import time
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from storage import Keep, Store, StoreError
from storage.actions import action_name
from storage.collect import Collected, collect
from storage.forget import use_name
from storage.leases import Lease
from tests.storage.faulty import FaultyOs, Killed, disk
from tests.storage.history import key_of, value
from tests.storage.samples import View, same
from tests.storage.test_store import record_of

NAMES = st.sampled_from("abcd")
NUMBERS = st.integers(1, 4)  # few, so that keys share objects
GRACE_S = 100.0
CALLS = st.integers(0, 90)


class StoreMachine(RuleBasedStateMachine):
    def __init__(self) -> None:
        super().__init__()
        self.folder = Path(tempfile.mkdtemp(prefix="garden-machine-"))
        self.store = Store.open(self.folder / "store", durability="none")
        self.contents: dict[str, str] = {}
        self.numbers: dict[str, int] = {}
        self.used: dict[str, float] = {}
        self.pinned: set[str] = set()
        self.leases: dict[str, Lease] = {}
        self.late = 0.0  # seconds by which the model's clock is ahead

    def teardown(self) -> None:
        self.store.leases.abandon_all()
        shutil.rmtree(self.folder)

    @property
    def now(self) -> float:
        return time.time() + self.late

    def noticed(self, name: str, number: int, content: str) -> None:
        self.contents[name], self.numbers[name] = content, number
        self.stamp(action_name(key_of(name)))
        self.used[name] = self.now

    def stamp(self, document: str) -> None:
        place = self.store.path / document
        if place.exists():
            os.utime(place, (self.now, self.now))

    @rule(name=NAMES, number=NUMBERS)
    def record(self, name: str, number: int) -> None:
        """Publish and record; the first result of a key counts."""
        counted = self.store.record(record_of(self.store, value(number), key=key_of(name)))
        content = counted.outputs["value"].content
        if name in self.contents:
            assert content == self.contents[name]
        else:
            self.noticed(name, number, content)
        self.stamp_object(counted.outputs["value"].object)

    def stamp_object(self, digest: str) -> None:
        self.stamp(f"objects/b3/{digest[3:5]}/{digest[5:]}/manifest.json")

    @rule(number=NUMBERS)
    def publish_only(self, number: int) -> None:
        self.stamp_object(self.store.publish(value(number)).object)

    @rule(name=NAMES)
    def read(self, name: str) -> None:
        record, reason = self.store.lookup(key_of(name))
        assert (reason == "hit") == (name in self.contents)
        if record is not None:
            self.store.medium.touch(use_name(record.key))  # a young record leaves no mark itself
            self.stamp(use_name(record.key))
            self.used[name] = self.now
            served = self.store.read(record.outputs["value"].object, View)
            assert same(served, value(self.numbers[name]))

    @rule(name=NAMES)
    def pin(self, name: str) -> None:
        if name not in self.pinned:
            self.store.pin(name, [key_of(name)])
            self.pinned.add(name)

    @rule(name=NAMES, number=NUMBERS, grace_s=st.sampled_from([0.0, GRACE_S]))
    def collect_what_is_held(self, name: str, number: int, grace_s: float) -> None:
        """Hold one key and let go of all others that may go."""
        self.record(name, number)
        self.pin(name)
        self.late += 2.0
        self.gc(0, grace_s)

    @precondition(lambda self: self.pinned)
    @rule(name=NAMES)
    def unpin(self, name: str) -> None:
        assert self.store.unpin(name) == (name in self.pinned)
        self.pinned.discard(name)

    @rule(name=NAMES)
    def lease(self, name: str) -> None:
        lease = self.store.acquire(key_of(name))
        assert (lease is None) == (name in self.leases)
        if lease is not None:
            self.leases[name] = lease

    @precondition(lambda self: self.leases)
    @rule(name=NAMES, how=st.sampled_from(["release", "expire"]))
    def end_lease(self, name: str, how: str) -> None:
        lease = self.leases.pop(name, None)
        if lease is None:
            return
        if how == "release":
            self.store.leases.release(lease)
        else:
            ended = Lease(lease.key, lease.token, lease.owner, expires_at=0.0)
            self.store.medium.replace(f"leases/{lease.key[3:]}.json", ended.to_bytes())

    @rule(seconds=st.floats(1.0, 200.0))
    def wait(self, seconds: float) -> None:
        self.late += seconds

    def held(self, name: str, grace_s: float) -> bool:
        young = self.now - self.used[name] <= grace_s
        return young or name in self.pinned or name in self.leases

    def collect(self, quota: int | None, grace_s: float) -> Collected:
        keep = Keep(unrecorded_s=-1.0)
        medium = self.store.medium
        return collect(medium, keep, quota_bytes=quota, grace_s=grace_s, now=self.now + 0.5)

    @precondition(lambda self: self.contents)
    @rule(quota=st.sampled_from([0, 0, 2000, None]), grace_s=st.sampled_from([0.0, 0.0, GRACE_S]))
    def gc(self, quota: int | None, grace_s: float) -> None:
        done = self.collect(quota, grace_s)
        self.forget({f.key for f in done.forgotten}, grace_s)
        assert done.bytes_left == self.store.size()
        if quota is None:
            assert done.forgotten == ()
        elif done.bytes_left > quota:
            assert all(self.held(name, grace_s + 1.0) for name in self.contents)
        assert {digest for digest, _size in self.store.objects()} == {
            record.outputs["value"].object for record in self.store.actions()
        }

    def forget(self, gone: set[str], grace_s: float) -> None:
        for name in [n for n in self.contents if key_of(n) in gone]:
            assert not self.held(name, grace_s - 1.0), f"{name} was held"
            del self.contents[name], self.numbers[name], self.used[name]

    @rule(name=NAMES, number=NUMBERS, at=CALLS, how=st.sampled_from(["kill", "power", "torn"]))
    def die_publishing(self, name: str, number: int, at: int, how: str) -> None:
        with disk(FaultyOs(at, how)):
            try:
                store = Store.open(self.store.path)
                store.record(record_of(store, value(number), key=key_of(name)))
            except Killed:
                pass
        found = self.store.action(key_of(name))
        if name in self.contents:
            assert found is not None
        elif found is not None:
            self.noticed(name, number, found.outputs["value"].content)

    @rule(at=CALLS, how=st.sampled_from(["kill", "power", "torn"]))
    def die_collecting(self, at: int, how: str) -> None:
        with disk(FaultyOs(at, how)):
            try:
                medium = Store.open(self.store.path).medium
                collect(medium, Keep(unrecorded_s=-1.0), quota_bytes=0, grace_s=GRACE_S,
                        now=self.now)  # fmt: skip
            except Killed:
                pass
        there = {record.key for record in self.store.actions()}
        self.forget({key_of(n) for n in self.contents if key_of(n) not in there}, GRACE_S)

    @precondition(lambda self: self.contents)
    @rule()
    def repair(self) -> None:
        self.store.repair()

    @invariant()
    def holds(self) -> None:
        assert self.store.verify("full") == []
        assert {r.key for r in self.store.actions()} == {key_of(n) for n in self.contents}
        assert {pin.name for pin in self.store.pins()} == self.pinned
        try:
            for name in self.contents:
                assert self.store.lookup(key_of(name), mend=False)[1] == "hit"
        except StoreError as error:
            raise AssertionError(str(error)) from error


def machine(examples: int) -> type:
    case = type(f"StoreMachine{examples}", (StoreMachine,), {}).TestCase
    case.settings = settings(
        max_examples=examples,
        stateful_step_count=25,
        deadline=None,
        suppress_health_check=[HealthCheck.too_slow],
    )
    return case


class TestStoreMachine(machine(20)):  # type: ignore[misc]
    """No dangling action, sealed and self-naming objects, held results stay."""


@pytest.mark.slow
class TestStoreMachineLong(machine(300)):  # type: ignore[misc]
    """The same, for longer."""
