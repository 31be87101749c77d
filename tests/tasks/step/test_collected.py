"""The step shell and a collector: what a run needs stays, what went is explained."""

from __future__ import annotations

from pathlib import Path

import pytest

from storage import Keep, Store
from storage.quota import HIGH_WATER
from tasks.step import RunContext, StepFailed, load, run_context
from tests.storage.history import age
from tests.tasks.step.toy import Numbers, Scaling, chain, in_run, make, ran, scale

ALL = Keep(unused_s=0.0, last=0, unrecorded_s=0.0)


def collect_all(store: Store) -> None:
    store.collect(grace_s=0.0, keep=ALL)


def test_explained_a_collected_result_is_made_again_as_evicted(store: Store) -> None:
    first, _context = in_run(store, chain)
    collect_all(store)
    assert list(store.actions()) == []
    ran.clear()
    _plan, planned = in_run(store, lambda: make(4), "plan")
    assert planned.plan[0].why.code == "evicted"
    again, context = in_run(store, chain)
    assert {e.why.code for e in context.outcomes} == {"evicted"}
    assert (len(ran), again.content) == (3, first.content)


def test_explained_after_a_collection_too_a_change_is_named(store: Store) -> None:
    in_run(store, chain)
    collect_all(store)
    _ref, context = in_run(store, lambda: chain(3.0))
    why = {e.step: e.why for e in context.outcomes}
    assert (why["make"].code, why["scale"].code) == ("evicted", "config")
    assert why["scale"].sentence == "config.factor 2.0 -> 3.0"


def test_explained_also_when_nothing_is_known_of_what_went(store: Store) -> None:
    ref, _context = in_run(store, chain)
    store.medium.delete(f"actions/{ref.key[3:5]}/{ref.key[5:]}.json")
    _ref, context = in_run(store, chain)
    assert [e.outcome for e in context.outcomes] == ["cached", "cached", "executed"]
    assert context.outcomes[-1].why.code == "evicted"


def test_a_run_in_progress_keeps_its_scene(store: Store) -> None:
    with run_context(RunContext(store, "room")):
        ref = chain()
        for record in store.actions():
            age(store, record, 9)
        collect_all(store)
        assert len(load(ref, Numbers).values) == 2
    assert store.pins() == []
    collect_all(store)
    assert list(store.objects()) == []


def test_a_run_that_only_finds_what_is_there_pins_nothing(store: Store) -> None:
    in_run(store, chain)
    with run_context(RunContext(store, "room")):
        chain()
        assert store.pins() == []


def test_a_result_that_is_collected_under_a_run_is_made_again(store: Store) -> None:
    in_run(store, chain)
    ran.clear()

    def body() -> object:
        made = make(4)
        collect_all(store)  # all were hits so far: nothing is pinned
        return scale(made, Scaling(7.0))

    _ref, context = in_run(store, body)
    assert ran == ["make", "scale"]
    assert [(e.step, e.outcome) for e in context.outcomes] == [
        ("make", "cached"),
        ("make", "executed"),
        ("scale", "executed"),
    ]
    assert store.verify() == []


def with_quota(path: Path, size: int) -> Store:
    return Store.open(path, durability="none", quota_bytes=size)


def test_at_its_high_water_mark_a_store_collects_what_nobody_used(store: Store) -> None:
    in_run(store, lambda: [make(n) for n in range(20)], scene="old")
    for record in store.actions():
        age(store, record, 9)
    size = store.size()
    small = with_quota(store.path, size)
    in_run(small, lambda: make(30), scene="new")
    assert store.size() < HIGH_WATER * size
    assert len(list(store.latest_of_scene("new"))) == 1
    assert store.verify() == []


def test_fail_loud_a_store_at_its_quota_fails_a_step_before_it_starts(store: Store) -> None:
    in_run(store, lambda: make(4))
    ran.clear()
    full = with_quota(store.path, store.size())
    with pytest.raises(StepFailed, match="quota") as caught:
        in_run(full, lambda: make(5))
    assert caught.value.kind == "StoreFull"
    assert ran == []
    cached, _context = in_run(full, lambda: make(4))
    assert cached.outcome == "cached"


def test_the_quota_is_read_from_the_environment(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    in_run(store, lambda: make(4))
    monkeypatch.setenv("GARDEN_STORE_QUOTA", "100 B")
    with pytest.raises(StepFailed, match="quota of 100 B"):
        in_run(Store.open(store.path), lambda: make(5))
    monkeypatch.setenv("GARDEN_STORE_QUOTA", "much")
    with pytest.raises(Exception, match="50GB"):
        Store.open(store.path)
