"""A proposal is a step like any other: cached, explained, and alone in what it costs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from garden_models.scene import Capture, Photo, Target
from garden_models.targets.config import ProposeTargets
from garden_models.targets.proposal import TargetProposal
from storage import Store
from tasks.propose_targets import check_targets, propose_targets
from tasks.step import Ref, RunContext, StepFailed, load, run_context
from tests.vlm_server import KEY, Reply, VlmServer, targets_json

GOOD = targets_json(("mug", "P1", [300, 100, 700, 200]))
BETTER = targets_json(("mug", "P1", [300, 100, 700, 300]))
CAPTURE = Capture((Photo("a.jpg", np.zeros((50, 100, 3), np.uint8), (1000, 500)),))


@pytest.fixture
def config(vlm_config: ProposeTargets) -> ProposeTargets:
    return vlm_config


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store.open(tmp_path / "store", durability="none")


def run(
    store: Store,
    config: ProposeTargets,
    engine: Any = "local",
) -> tuple[Ref, list[tuple[str, str]]]:
    """Return the checked proposal's reference, and what became of both steps."""
    context = RunContext(store, "desk", engine)
    with run_context(context):
        first = propose_targets(CAPTURE, (), config)
        last = check_targets(CAPTURE, (), first, config)
    outcomes = [(e.step, str(e.outcome)) for e in context.outcomes]
    return last, outcomes or [(e.step, e.action) for e in context.plan]


def value(store: Store, ref: Ref) -> TargetProposal:
    with run_context(RunContext(store, "desk")):
        found: TargetProposal = load(ref, TargetProposal)
    return found


@pytest.fixture
def ask(store: Store, config: ProposeTargets) -> Callable[..., Any]:
    return lambda **changes: run(store, replace(config, **changes))


def test_both_answers_are_kept_and_asked_for_once(
    store: Store,
    vlm: VlmServer,
    ask: Callable[..., Any],
) -> None:
    vlm.say(GOOD, BETTER)
    ref, outcomes = ask()
    assert outcomes == [("propose_targets", "executed"), ("check_targets", "executed")]
    found = value(store, ref)
    assert found.targets == (Target("mug", "a.jpg", (100.0, 150.0, 300.0, 350.0)),)
    assert [q.answer for q in found.queries] == [GOOD, BETTER]
    assert [(q.input_tokens, q.output_tokens) for q in found.queries] == [(1200, 100)] * 2
    again, outcomes = ask()
    assert again.content == ref.content
    assert {did for _, did in outcomes} == {"cached"}
    assert len(vlm.asked) == 2


def test_address_key_and_patience_are_no_part_of_the_key(
    vlm: VlmServer,
    ask: Callable[..., Any],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    vlm.say(GOOD, GOOD)
    ref, _outcomes = ask()
    monkeypatch.delenv("GARDEN_TEST_DOOR")
    changes = {"address": "http://127.0.0.1:9", "key_variable": "", "timeout_s": 1.0, "tries": 1}
    again, outcomes = ask(**changes)
    assert again.key == ref.key
    assert {did for _, did in outcomes} == {"cached"}


@pytest.mark.parametrize(
    "change",
    [{"model": "gemini-4"}, {"goal": "all fall down"}, {"boxes": "xyxy_1000"}, {"attempt": 2},
     {"max_targets": 3}, {"photo_side": 512}, {"temperature": 0.5}],
)  # fmt: skip
def test_what_changes_the_answer_asks_again(
    change: dict[str, Any],
    vlm: VlmServer,
    ask: Callable[..., Any],
) -> None:
    vlm.say(*[GOOD] * 4)
    ask()
    _ref, outcomes = ask(**change)
    assert outcomes[0] == ("propose_targets", "executed")


def test_a_check_that_could_not_be_made_costs_no_second_proposal(
    vlm: VlmServer,
    ask: Callable[..., Any],
) -> None:
    vlm.say(GOOD, *[Reply(status=429)] * 3)
    with pytest.raises(StepFailed, match="takes no more requests") as caught:
        ask()
    assert (caught.value.step, caught.value.retryable) == ("check_targets", True)
    vlm.say(BETTER)
    _ref, outcomes = ask()
    assert outcomes == [("propose_targets", "cached"), ("check_targets", "executed")]


@pytest.mark.parametrize(
    ("replies", "kind"),
    [([Reply(status=401)], "ModelUnavailable"), ([Reply("")], "ModelUnavailable"),
     ([Reply(status=503)] * 3, "ModelUnavailable"), (["no boxes here"], "BadInput")],
)  # fmt: skip
def test_a_failure_is_not_kept_and_not_retried_by_the_step(
    replies: list[Reply | str],
    kind: str,
    vlm: VlmServer,
    ask: Callable[..., Any],
) -> None:
    vlm.say(*replies)
    with pytest.raises(StepFailed) as caught:
        ask()
    assert caught.value.kind == kind
    assert len(vlm.asked) == len(replies)
    vlm.say(GOOD, GOOD)
    _ref, outcomes = ask()
    assert outcomes[0] == ("propose_targets", "executed")


def test_a_plan_asks_nobody(
    store: Store,
    vlm: VlmServer,
    config: ProposeTargets,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv("GARDEN_TEST_DOOR")
    ref, planned = run(store, config, "plan")
    assert planned == [("propose_targets", "would run"), ("check_targets", "would run")]
    assert ref.pending
    assert vlm.asked == []


def test_the_key_is_nowhere_in_the_store(
    store: Store,
    vlm: VlmServer,
    ask: Callable[..., Any],
) -> None:
    talkative = targets_json(("mug", "P1", [300, 100, 700, 200]), said=f"with {KEY}")
    vlm.say(talkative, f"{GOOD} {KEY}", Reply(status=401, body=KEY.encode()))
    ask()
    with pytest.raises(StepFailed) as caught:
        ask(attempt=2)
    assert KEY not in str(caught.value)
    files = [path for path in store.path.rglob("*") if path.is_file()]
    assert files
    assert not any(KEY.encode() in path.read_bytes() for path in files)
