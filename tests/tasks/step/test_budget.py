"""Two cores or one GPU are full but never over-full, whoever asks, and nobody waits for ever."""

from __future__ import annotations

import fcntl
import json
import multiprocessing
import os
import random
import signal
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import pytest

from storage import Store
from tasks.step import Budget, Need, StepFailed, slots, step
from tasks.step import budget as budget_module
from tasks.step.machine import usable_cores, usable_memory_gb
from tasks.step.ref import Cancelled
from tests.tasks.step.toy import Numbers, Scaling, apart, fan, in_run, make, spins

SPAWN = multiprocessing.get_context("spawn")


def budget(folder: Path, cores: int = 2, memory_gb: float = 2.0, gpus: int = 1) -> Budget:
    folder.mkdir(exist_ok=True)
    names = tuple(str(i) for i in range(gpus))
    return Budget(tuple(range(cores)), memory_gb, names, folder)


@contextmanager
def counted(path: Path, need: Need, total: int) -> Iterator[None]:
    """Keep the sums of what all processes hold in a file, and the highest ones."""
    cores = total if need.cores == "all" else need.cores
    amounts = {"cores": cores, "memory": need.memory_gb, "gpus": need.gpus}
    _add(path, amounts, 1)
    try:
        yield
    finally:
        _add(path, amounts, -1)


def _add(path: Path, amounts: dict[str, float], sign: int) -> None:
    with path.open("r+") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        sums = json.load(file)
        for name, amount in amounts.items():
            sums[name] += sign * amount
            sums[f"most {name}"] = max(sums.get(f"most {name}", 0), sums[name])
        file.seek(0)
        file.truncate()
        json.dump(sums, file)
        file.flush()


def hold_at_random(folder: Path, counter: Path, seed: int, times: int) -> None:
    chance = random.Random(seed)
    for _ in range(times):
        need = Need(
            chance.choice((1, 1, 2, "all")),
            chance.choice((0.5, 1.0, 1.5)),
            chance.choice((0, 0, 1)),
        )
        with budget(folder).hold(need, threading.Event()), counted(counter, need, 2):
            time.sleep(chance.uniform(0, 0.004))


def hold_for_ever(folder: Path, marker: Path) -> None:
    with budget(folder).hold(Need("all", 2.0, 1), threading.Event()):
        marker.touch()
        time.sleep(600)


def test_the_budget_is_never_exceeded_by_threads_of_several_processes(tmp_path: Path) -> None:
    counter = tmp_path / "sums.json"
    counter.write_text(json.dumps({"cores": 0, "memory": 0, "gpus": 0}))
    arguments = [(tmp_path / "slots", counter, seed, 40) for seed in range(4)]
    workers = [SPAWN.Process(target=hold_at_random, args=a) for a in arguments[:3]]
    for worker in workers:
        worker.start()
    hold_at_random(*arguments[3])
    for worker in workers:
        worker.join(120)
        assert worker.exitcode == 0
    sums = json.loads(counter.read_text())
    assert {name: sums[name] for name in ("cores", "memory", "gpus")} == dict.fromkeys(
        ("cores", "memory", "gpus"), 0
    )
    assert (sums["most cores"], sums["most gpus"]) == (2, 1)
    assert sums["most memory"] <= 2.0


def test_what_a_killed_process_held_is_free_again(tmp_path: Path) -> None:
    marker = tmp_path / "holds"
    worker = SPAWN.Process(target=hold_for_ever, args=(tmp_path / "slots", marker))
    worker.start()
    until(marker.exists)
    ticket = slots.Ticket(tmp_path / "slots", {"core": 1}, {"core": ("0", "1")})
    assert not ticket.try_take()
    assert worker.pid is not None
    os.kill(worker.pid, signal.SIGKILL)
    worker.join()
    assert ticket.try_take()
    ticket.give_back()


def test_a_request_is_served_whole_or_not_at_all(tmp_path: Path) -> None:
    shared = budget(tmp_path / "slots")
    pool = {"core": ("0", "1"), "gpu": ("0",)}
    with shared.hold(Need(1, 0.5, 1), threading.Event()):
        both = slots.Ticket(shared.folder, {"core": 1, "gpu": 1}, pool)
        assert not both.try_take()
        one = slots.Ticket(shared.folder, {"core": 1}, pool)
        assert one.try_take(), "what cannot be used yet must not be kept from others"
        one.give_back()
    assert both.try_take()
    both.give_back()


def test_a_large_request_is_overtaken_only_while_it_is_patient(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shared = budget(tmp_path / "slots")
    pool = {"core": ("0", "1"), "gpu": ("0",)}
    with shared.hold(Need(1), threading.Event()):
        large = slots.Ticket(shared.folder, {"core": 2}, pool)
        assert not large.try_take()
        small = slots.Ticket(shared.folder, {"core": 1}, pool)
        assert small.try_take()
        small.give_back()
        monkeypatch.setattr(slots, "PATIENCE_S", 0.0)
        late = slots.Ticket(shared.folder, {"core": 1}, pool)
        assert not late.try_take(), "the free core is kept for the large request"
        aside = slots.Ticket(shared.folder, {"gpu": 1}, pool)
        assert aside.try_take(), "who takes nothing from it need not wait"
        aside.give_back()
    assert large.try_take()
    large.give_back()
    assert late.try_take()
    late.give_back()


def test_a_ticket_of_a_dead_process_keeps_nobody_waiting(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shared = budget(tmp_path / "slots")
    (shared.folder / "waiting").mkdir()
    (shared.folder / "waiting" / f"{0:020d}-gone").write_text('{"core": 2}')
    monkeypatch.setattr(slots, "PATIENCE_S", 0.0)
    with shared.hold(Need(1), threading.Event()):
        assert list((shared.folder / "waiting").iterdir()) == []


def test_who_waits_is_woken_as_soon_as_slots_are_free(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(budget_module, "_POLL_S", 600.0)
    shared = budget(tmp_path / "slots")
    with ThreadPoolExecutor(3) as pool:
        with shared.hold(Need("all"), threading.Event()):
            waiting = [pool.submit(take_and_give_back, shared) for _ in range(3)]
            until(lambda: len(list((shared.folder / "bells").iterdir())) == 3)
        for one in waiting:
            one.result(timeout=60)
    assert list((shared.folder / "bells").iterdir()) == []


def take_and_give_back(shared: Budget) -> None:
    with shared.hold(Need(1), threading.Event()):
        pass


def test_the_bell_of_a_dead_process_is_taken_down(tmp_path: Path) -> None:
    shared = budget(tmp_path / "slots")
    (shared.folder / "bells").mkdir()
    os.mkfifo(shared.folder / "bells" / f"{0:020d}-gone")
    take_and_give_back(shared)
    assert list((shared.folder / "bells").iterdir()) == []


def test_a_step_that_asks_for_more_than_there_is_gets_all_of_it(tmp_path: Path) -> None:
    shared = budget(tmp_path / "slots", cores=1, memory_gb=1.0, gpus=0)
    with shared.hold(Need(64, 512.0, 8), threading.Event()) as held:
        assert held.gpus == ()
        rest = slots.Ticket(shared.folder, {"core": 1}, {"core": ("0",)})
        assert not rest.try_take()
        rest.give_back()


def test_waiting_ends_when_the_run_is_stopped(tmp_path: Path) -> None:
    shared, stopped = budget(tmp_path / "slots"), threading.Event()
    with shared.hold(Need("all"), threading.Event()), ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(lambda: shared.hold(Need(1), stopped).__enter__())
        until(lambda: any((shared.folder / "waiting").iterdir()))
        stopped.set()
        with pytest.raises(Cancelled):
            waiting.result(timeout=30)
    assert list((shared.folder / "waiting").iterdir()) == []


def test_steps_of_a_run_keep_to_its_budget_and_tell_how_long_they_waited(
    store: Store, tmp_path: Path
) -> None:
    shared = budget(tmp_path / "slots", cores=1)
    spins.clear()
    _refs, context = in_run(store, lambda: fan(3), budget=shared, workers=3)
    assert max(spins) == 1
    assert sum(event.seconds.wait > 0.05 for event in context.outcomes) >= 2
    spins.clear()
    in_run(store, lambda: fan(3, first=3), workers=3)
    assert max(spins) > 1, "without a budget they run at once"


def test_an_isolated_step_sees_only_the_gpus_that_it_holds(store: Store, tmp_path: Path) -> None:
    ref, _context = in_run(store, lambda: sees_gpus("x"), budget=budget(tmp_path / "slots", gpus=3))
    assert store.read(ref.object, Numbers).values.tolist() == [2.0]


@step(version=1, isolated=True, gpus=1)
def sees_gpus(note: str) -> Numbers:
    import numpy as np

    return Numbers(np.array([float(x) for x in os.environ["CUDA_VISIBLE_DEVICES"].split(",")]))


def test_a_damaged_input_is_made_again_inside_the_part_that_is_held(
    store: Store, tmp_path: Path
) -> None:
    """Its step needs a core too: waiting for one, while holding the only one, would not end."""
    from tests.tasks.step.test_faults import ruin

    made, _context = in_run(store, lambda: make(4))
    ruin(store, made.object, "flip")
    shared = budget(tmp_path / "slots", cores=1, memory_gb=0.5)
    ref, context = in_run(store, lambda: apart(make(4), Scaling()), budget=shared, isolate=False)
    assert [e.outcome for e in context.outcomes] == ["cached", "executed", "executed"]
    assert store.read(ref.object, Numbers).values[0] == 1.0


def test_more_than_the_machine_has_is_refused_in_words(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="10000 cores"):
        Budget.of_machine(cores=10_000, folder=tmp_path)
    machine = Budget.of_machine(folder=tmp_path)
    assert machine.cores == usable_cores()
    assert machine.memory_gb == usable_memory_gb()
    assert Budget.from_json(json.loads(json.dumps(machine.to_json()))) == machine


def test_a_stopped_run_leaves_no_slot_taken(store: Store, tmp_path: Path) -> None:
    shared = budget(tmp_path / "slots", cores=1)
    with pytest.raises(StepFailed, match="a sentence"):
        in_run(store, lambda: apart(make(2), Scaling(note="bad")), budget=shared, isolate=False)
    free = slots.Ticket(shared.folder, {"core": 1}, {"core": ("0",)})
    assert free.try_take()
    free.give_back()


def until(true: object, seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not true():  # type: ignore[operator]
        assert time.monotonic() < end
        time.sleep(0.01)
