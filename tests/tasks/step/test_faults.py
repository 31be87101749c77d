"""The step shell when things break: damage, races, full disks, steps that are not steady."""

from __future__ import annotations

import errno
import threading
from pathlib import Path

import numpy as np
import pytest

from storage import CorruptArtifact, Store
from tasks.step import Ref, RunContext, StepFailed, load, run_context, step
from tests.storage.faulty import FaultyOs, disk
from tests.tasks.step.toy import Numbers, Scaling, chain, in_run, make, ran, scale


def test_hit_means_verified_damage_is_found_and_mended(store: Store) -> None:
    """A hit whose bytes are damaged is a miss with a reason; the result is the same again."""
    first, _context = in_run(store, chain)
    for damage in ("flip", "truncate", "remove"):
        ran.clear()
        ruin(store, first.object, damage)
        verifying = Store.open(store.path, durability="none", verify="full")
        again, context = in_run(verifying, chain)
        assert ran == ["pick bulldozer"], damage
        assert context.outcomes[-1].why.code == "corrupt"
        assert again.content == first.content
        assert store.verify("full") == []


def ruin(store: Store, digest: str, damage: str) -> None:
    member = max(
        (p for p in store.folder(digest).rglob("*") if p.is_file() and p.name.startswith("c.")),
        key=lambda p: p.stat().st_size,
    )
    data = bytearray(member.read_bytes())
    member.chmod(0o644)
    if damage == "flip":
        data[len(data) // 2] ^= 1
        member.write_bytes(bytes(data))
    elif damage == "truncate":
        member.write_bytes(bytes(data[:-1]))
    else:
        member.unlink()


def test_damage_that_only_reading_finds_is_mended_too(store: Store) -> None:
    """The quick check misses a flipped bit; loading the input does not, and makes it again."""
    in_run(store, lambda: scale(make(4), Scaling(2.0)))
    made, _context = in_run(store, lambda: make(4))
    ruin(store, made.object, "flip")
    ran.clear()
    ref, context = in_run(store, lambda: scale(make(4), Scaling(5.0)))
    assert ran == ["make", "scale"]
    assert [(e.step, e.outcome) for e in context.outcomes] == [
        ("make", "cached"),
        ("make", "executed"),
        ("scale", "executed"),
    ]
    assert context.outcomes[1].why.code == "corrupt"
    assert store.verify("full") == []
    ruin(store, ref.object, "flip")
    with pytest.raises(CorruptArtifact):
        in_run(store, lambda: load(ref, Numbers))


def test_single_flight_two_threads_one_execution(store: Store) -> None:
    start = threading.Barrier(2)
    refs: list[Ref] = []

    def run() -> None:
        with run_context(RunContext(Store.open(store.path, durability="none"), "room")):
            start.wait()
            refs.append(chain())

    threads = [threading.Thread(target=run) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(ran) == ["make", "pick bulldozer", "scale"]
    assert refs[0].object == refs[1].object
    assert list((store.path / "leases").glob("*.json")) == []


def test_fail_loud_a_full_disk_fails_the_step(store: Store) -> None:
    class Full(FaultyOs):
        def write(self, path: Path, data: object) -> None:
            if path.name == "zarr.json":
                raise OSError(errno.ENOSPC, "No space left on device")
            super().write(path, data)

    with disk(Full()), pytest.raises(StepFailed) as caught:
        in_run(store, chain)
    assert caught.value.kind == "StoreFull"
    assert "free space there" in caught.value.reason
    assert store.verify("full") == []
    in_run(store, chain)
    assert store.verify("full") == []


@step(version=1)
def unsteady(count: int) -> Numbers:
    ran.append("unsteady")
    return Numbers(np.array([float(len(ran))]))


def test_write_once_a_step_that_is_not_deterministic_is_found_out(store: Store) -> None:
    first, _context = in_run(store, lambda: unsteady(1))
    again, _context = in_run(store, lambda: unsteady(1), force=frozenset({"*"}))
    assert again.object == first.object
    assert "came out different" in again.reasons[-1]
    assert len(list((store.path / "conflicts").rglob("*.json"))) == 1


def test_same_as_cold_from_any_state_of_the_store(store: Store, tmp_path: Path) -> None:
    warm: list[str] = []
    for factor in (1.0, 2.0, 3.0, 2.0, 1.0):
        warm.append(in_run(store, lambda f=factor: chain(f))[0].content)
    cold = [
        in_run(Store.open(tmp_path / f"cold{i}", durability="none"), lambda f=factor: chain(f))[0]
        for i, factor in enumerate((1.0, 2.0, 3.0, 2.0, 1.0))
    ]
    assert warm == [ref.content for ref in cold]
