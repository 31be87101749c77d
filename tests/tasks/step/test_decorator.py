"""The step shell without Prefect: hits, misses, reasons, failures, plans, futures."""

from __future__ import annotations

import dataclasses
import errno
import json
from concurrent.futures import Future
from typing import Any

import numpy as np
import pytest

from storage import Store
from tasks.step import (
    PendingValue,
    Ref,
    RunContext,
    StepEvent,
    StepFailed,
    fan_out,
    load,
    run_context,
    step,
    step_scratch,
)
from tasks.step import execute as execution
from tests.tasks.step.toy import (
    Numbers,
    Scaling,
    chain,
    gather,
    in_run,
    make,
    pick,
    ran,
    scale,
    target,
)


def test_a_second_run_executes_nothing(store: Store) -> None:
    first, context = in_run(store, chain)
    assert ran == ["make", "scale", "pick bulldozer"]
    assert [e.outcome for e in context.outcomes] == ["executed"] * 3
    assert {e.why.code for e in context.outcomes if e.why} == {"new"}
    again, context = in_run(store, chain)
    assert len(ran) == 3
    assert [e.outcome for e in context.outcomes] == ["cached"] * 3
    assert {e.why.code for e in context.outcomes if e.why} == {"hit"}
    assert (again.content, again.object, again.seconds) == (
        first.content,
        first.object,
        first.seconds,
    )


def test_refs_are_small_and_survive_json(store: Store) -> None:
    ref, _context = in_run(store, chain)
    text = json.dumps(ref.to_json())
    assert len(text) < 1000
    again = Ref.from_json(json.loads(text))
    assert dataclasses.asdict(again) == dataclasses.asdict(ref)
    assert (ref.kind, ref.step, ref.label) == ("Numbers", "pick", "bulldozer")


def test_values_are_loaded_and_a_label_is_inherited(store: Store) -> None:
    def body() -> tuple[Ref, Any, Any]:
        ref = scale(chain(), Scaling(10.0))
        return ref, load(ref, Numbers), load(ref, Numbers, fields=("verdict",))

    (ref, value, fields), _context = in_run(store, body)
    assert ref.label == "bulldozer"
    assert value.values.tolist() == [0.0, 20.0]
    assert fields == {"verdict": value.verdict}


def test_early_cutoff_an_unchanged_result_stops_the_rerun(store: Store) -> None:
    in_run(store, lambda: scale(scale(make(1), Scaling(2.0)), Scaling(1.0)))
    ran.clear()
    _ref, context = in_run(store, lambda: scale(scale(make(1), Scaling(3.0)), Scaling(1.0)))
    assert ran == ["scale"]  # zero times three is still zero
    assert [e.outcome for e in context.outcomes] == ["cached", "executed", "cached"]


def test_explained_what_changed_is_named(store: Store) -> None:
    in_run(store, chain)
    _ref, context = in_run(store, lambda: chain(3.0))
    why = {e.step: e.why for e in context.outcomes}
    assert (why["make"].code, why["scale"].code, why["pick"].code) == ("hit", "config", "input")
    assert why["scale"].sentence == "config.factor 2.0 -> 3.0"
    assert why["pick"].sentence == "input numbers changed"
    _ref, context = in_run(store, lambda: chain(3.0), scene="other")
    assert {e.outcome for e in context.outcomes} == {"cached"}  # another scene, equal content


def test_a_plan_names_what_would_run_and_does_nothing(store: Store) -> None:
    in_run(store, chain)
    ran.clear()
    files = sorted(store.path.rglob("*"))
    ref, context = in_run(store, lambda: chain(3.0), "plan")
    assert ran == []
    assert sorted(store.path.rglob("*")) == files
    assert [(p.step, p.action, p.why.code) for p in context.plan] == [
        ("make", "cached", "hit"),
        ("scale", "would run", "config"),
        ("pick", "would run", "upstream"),
    ]
    assert ref.pending
    assert context.plan[2].why.sentence == "scale would run first"
    with pytest.raises(PendingValue, match="not known before"):
        in_run(store, lambda: load(ref, Numbers), "plan")
    ref, context = in_run(store, chain, "plan")
    assert not ref.pending
    assert {p.action for p in context.plan} == {"cached"}


def test_a_plan_follows_futures_and_fan_out(store: Store) -> None:
    def body() -> Ref:
        numbers = scale.submit(make.submit(4), Scaling())
        return gather(tuple(pick.submit(target(n), numbers) for n in ("a", "b")))

    ref, context = in_run(store, body, "plan")
    assert ref.pending
    assert [p.step for p in context.plan] == ["make", "scale", "pick", "pick", "gather"]
    assert [p.label for p in context.plan] == ["", "", "a", "b", ""]


def test_forced_steps_run_again_and_the_first_result_stays(store: Store) -> None:
    first, _context = in_run(store, chain)
    ran.clear()
    again, context = in_run(store, chain, force=frozenset({"pick[bulldozer]"}))
    assert ran == ["pick bulldozer"]
    assert context.outcomes[-1].why.code == "forced"
    assert again.object == first.object


def test_tuples_none_and_values_as_inputs(store: Store) -> None:
    def body() -> list[Ref]:
        a, b = make(1), make(2)
        return [
            gather((a, b)),
            gather([a, b], None),
            gather((b, a)),
            gather((a,), b),
            gather((Numbers(np.arange(1.0)), Numbers(np.arange(2.0)))),
        ]

    refs, _context = in_run(store, body)
    assert len({refs[0].key, refs[1].key, refs[4].key}) == 1
    assert len({ref.key for ref in refs}) == 3


def test_a_failed_verdict_is_published_and_left_to_the_flow(store: Store) -> None:
    ref, _context = in_run(store, lambda: pick(target("weak"), make(3)))
    assert (ref.status, ref.reasons, ref.failed) == ("degraded", ("few",), False)
    again, _context = in_run(store, lambda: pick(target("weak"), make(3)))
    assert (again.outcome, again.status, again.reasons) == ("cached", "degraded", ("few",))


def test_bad_input_fails_at_once_with_its_own_sentence(store: Store) -> None:
    context = RunContext(store, "room")
    with pytest.raises(StepFailed) as caught, run_context(context):
        pick(target("bad"), make(3))
    failure = caught.value
    assert str(failure) == "pick[bad]: the box of bad lies outside of a.jpg: correct it"
    assert (failure.kind, failure.retryable) == ("BadInput", False)
    assert ran.count("pick bad") == 1
    event = context.outcomes[-1]
    assert (event.outcome, event.status, event.error) == ("failed", "failed", failure.reason)


def test_one_failed_target_stops_no_other(store: Store) -> None:
    def body() -> list[Any]:
        numbers = make(4)
        return fan_out(lambda t: scale(pick(t, numbers), Scaling()), map(target, ("a", "bad", "c")))

    results, _context = in_run(store, body)
    assert [getattr(r, "label", "") for r in results] == ["a", "bad", "c"]
    assert isinstance(results[1], StepFailed)


def test_futures_chain_and_carry_failures(store: Store) -> None:
    def body() -> list[Future[Ref]]:
        numbers = make.submit(4)
        good = scale.submit(pick.submit(target("a"), numbers), Scaling())
        bad = scale.submit(pick.submit(target("bad"), numbers), Scaling())
        both = gather.submit((good, bad))
        for future in (good, bad, both):
            future.exception()
        return [good, bad, both]

    (good, bad, both), _context = in_run(store, body, workers=1)
    assert good.result().label == "a"
    for future in (bad, both):
        with pytest.raises(StepFailed, match=r"pick\[bad\]"):
            future.result()


def test_events_tell_the_story(store: Store) -> None:
    events: list[StepEvent] = []
    in_run(store, chain, events=events.append)
    assert [(e.kind, e.step) for e in events] == [
        ("started", "make"),
        ("finished", "make"),
        ("started", "scale"),
        ("finished", "scale"),
        ("started", "pick"),
        ("progress", "pick"),
        ("finished", "pick"),
    ]
    assert (events[5].share, events[5].doing) == (0.5, "picking")
    last = events[-1]
    assert last.ref is not None
    assert last.seconds.load > 0
    assert last.seconds.publish > 0
    assert last.peak_mb > 10
    assert last.backend == "embedded"


failures: list[Exception] = []


@step(version=1)
def shaky(count: int) -> Numbers:
    if failures:
        raise failures.pop()
    return Numbers(np.zeros(count))


@pytest.mark.parametrize(
    ("error", "attempts"),
    [
        (OSError(errno.EIO, "I/O error"), 2),
        (MemoryError(), 2),
        (OSError("cannot identify image file"), 1),
        (FileNotFoundError(errno.ENOENT, "gone"), 1),
        (ValueError("wrong"), 1),
    ],
)
def test_only_faults_that_may_pass_are_tried_again(
    store: Store, monkeypatch: pytest.MonkeyPatch, error: Exception, attempts: int
) -> None:
    monkeypatch.setattr(execution, "_BACK_OFF_S", 0.001)
    failures[:] = [error]
    if attempts == 1:
        with pytest.raises(StepFailed, match=type(error).__name__):
            in_run(store, lambda: shaky(2))
        return
    ref, _context = in_run(store, lambda: shaky(2))
    assert store.action(ref.key).attempt == attempts
    failures[:] = [error] * 5
    with pytest.raises(StepFailed):
        in_run(store, lambda: shaky(3))
    assert len(failures) == 2  # three attempts


def test_scratch_is_removed(store: Store) -> None:
    def body() -> Any:
        with step_scratch() as folder:
            (folder / "x").write_text("x")
            assert folder.is_relative_to(store.path)
        return folder

    folder, _context = in_run(store, body)
    assert not folder.exists()
    with step_scratch() as outside:
        assert outside.is_dir()


def test_a_call_outside_of_a_run_says_what_to_do() -> None:
    with pytest.raises(LookupError, match="run_context"):
        make(3)
    assert make.fn(3).values.tolist() == [0.0, 1.0, 2.0]
    with pytest.raises(ValueError, match="isolated=True"):
        step(version=1, time_limit_s=1.0)


def test_a_stopped_run_starts_nothing_more(store: Store) -> None:
    context = RunContext(store, "room")
    context.cancelled.set()
    with pytest.raises(StepFailed, match="stopped") as caught, run_context(context):
        make(3)
    assert caught.value.kind == "Cancelled"
    assert ran == []
