"""Kill three writers of one store and a collector beside them, all at random moments."""

from __future__ import annotations

import dataclasses
import random
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from storage import CorruptArtifact, Keep, MissingArtifact, Store
from tests.faults.forks import fork, in_own_process, kill, print_counts, tell, told
from tests.faults.part import Count, part
from tests.storage.history import key_of, value
from tests.storage.samples import View, same
from tests.storage.test_store import record_of

WRITERS = 3
KEYS = 12
SEED = 20
WHOLE = 200


def write(path: Path, log: Path, seed: int) -> None:
    """Compute keys as steps do, for ever; tell of any hit that is not what it should be."""
    chance = random.Random(seed)
    store = Store.open(path)
    while True:
        number = chance.randrange(KEYS)
        record, _reason = store.lookup(key_of(f"k{number}"))
        try:
            if record is not None:
                served = store.read(record.outputs["value"].object, View)
                if not same(served, value(number)) and record.host != "unsteady":
                    tell(log, f"k{number} was served as {served.photo}")
                continue
            lease = store.acquire(key_of(f"k{number}"))
            if lease is None:
                continue
            compute(store, number, unsteady=chance.random() < 0.1)
            store.leases.release(lease)
        except (MissingArtifact, CorruptArtifact) as error:
            if isinstance(error, CorruptArtifact) and store.medium.members(error.object_digest):
                tell(log, f"while it stood there: {error}")


def compute(store: Store, number: int, *, unsteady: bool = False) -> None:
    """Publish and record what belongs to a key, or once in a while something else."""
    made = value(number + 100 if unsteady else number)
    host = "unsteady" if unsteady else "steady"
    record = record_of(store, made, key=key_of(f"k{number}"), scene=f"s{number % 3}", host=host)
    store.remember_latest(store.record(record), record.scene, record.label)


def collect(path: Path, seed: int) -> None:
    """Collect as hard as can be, for ever."""
    chance = random.Random(seed)
    store = Store.open(path)
    while True:
        keep = Keep(unrecorded_s=chance.choice((-1.0, 3600.0)), evidence_s=3600.0)
        store.collect(quota_bytes=chance.choice((0, 8_000)), grace_s=0.0, keep=keep)
        time.sleep(chance.uniform(0.0, 0.02))


def trial(path: Path, log: Path, chance: random.Random) -> Iterator[str]:
    """Let them run, kill them one after the other, and look; give every violation."""
    children = [
        fork(lambda seed=seed: write(path, log, seed), log)  # type: ignore[misc]
        for seed in [chance.random() for _ in range(WRITERS)]
    ]
    seed = chance.random()
    children.append(fork(lambda: collect(path, seed), log))
    chance.shuffle(children)
    for child in children:
        time.sleep(chance.uniform(0.0, 0.06))
        kill(child)
    yield from told(log)
    store = Store.open(path)
    yield from map(str, store.verify("full"))
    yield from (r.key for r in store.actions() if store.lookup(r.key, mend=False)[1] != "hit")


def converge(path: Path) -> Iterator[str]:
    """Finish all keys undisturbed and collect; give every violation."""
    store = Store.open(path)
    for number in range(KEYS):
        record, _reason = store.lookup(key_of(f"k{number}"))
        if record is None:
            lease = store.acquire(key_of(f"k{number}"))
            if lease is None:
                yield f"k{number} is still leased to a dead process"
                continue
            compute(store, number)
            store.leases.release(lease)
    if len(list(store.actions())) != KEYS:
        yield "not every key has its action"
    store.collect(keep=dataclasses.replace(Keep(), unrecorded_s=-1.0))
    needed = {record.outputs["value"].object for record in store.actions()}
    if set(store.medium.objects()) != needed:
        yield "objects are left that no action needs"
    for place in ("tmp", "trash"):
        if (path / place).exists() and any((path / place).iterdir()):
            yield f"something is left in {place}"
    if list((path / "leases").glob("*.json")):
        yield "leases are left"
    yield from map(str, store.verify("full"))


def soak(folder: Path, trials: int) -> Count:
    """Do it so often, on the same store, so that what one leaves meets the next."""
    path, log = folder / "store", folder / "told"
    chance = random.Random(SEED)
    Store.open(path)
    found: list[str] = []
    for number in range(trials):
        found += (f"trial {number}: {violation}" for violation in trial(path, log, chance))
    found += (f"in the end: {violation}" for violation in converge(path))
    return Count(f"{WRITERS} writers and a collector, kill -9", trials, tuple(found))


@part("soak")
def whole(folder: Path) -> list[Count]:
    return in_own_process("soak", str(folder), str(WHOLE))


if __name__ == "__main__":
    print_counts([soak(Path(sys.argv[1]), int(sys.argv[2]))])
