"""A model in a process of its own: what goes wrong there costs one step, and is told in a sentence.

Everything here runs real processes through real steps; beside the step that fails, another
target's step goes on.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from garden_models.foundation.failure import ModelFailed, ModelOutOfMemory
from storage import Store
from tasks.model import predictor
from tasks.model.exchange import exchange_root
from tasks.model.log import log_file
from tasks.model.resident import residents
from tasks.model.settings import settings_file
from tasks.step import Ref, RunContext, StepEvent, StepFailed, compute, fan_out, run_context
from tasks.step.memory import peak_memory, process_rss
from tests.tasks.model import liar
from tests.tasks.model.doubler import loads
from tests.tasks.model.nouns import Answer, Question
from tests.tasks.model.steps import TARGETS, Asking, ask
from tests.tasks.step.test_isolate import alive, wait_for

QUESTION = Question(np.ones((3, 2)))


def settings(**doubler: object) -> None:
    """Have the doubler run in a process of its own."""
    lines = [f"{name} = {json.dumps(value)}" for name, value in doubler.items()]
    settings_file().parent.mkdir(parents=True, exist_ok=True)
    settings_file().write_text("\n".join(["[doubler]", *lines]))


@pytest.fixture
def apart(models: Path) -> Path:
    settings(python=sys.executable, time_limit_s=60)
    return models / "doubler"


def run(store: Store, **how: str) -> dict[str, Ref | StepFailed]:
    """Ask for every target, one of them so that something goes wrong; give what came of each."""
    config = Asking(how=tuple(how.items()))
    with run_context(RunContext(store, "room", workers=1)):
        outcomes = fan_out(partial(ask, config=config), TARGETS)
    return dict(zip((t.name for t in TARGETS), outcomes, strict=True))


def reason(store: Store, how: str) -> tuple[str, str]:
    """Return how the odd target's step failed; the others must have gone on."""
    outcomes = run(store, odd=how)
    for name in ("good", "late"):
        ref = outcomes[name]
        assert isinstance(ref, Ref), f"{name}: {ref}"
        assert store.read(ref.object, Answer).values.tolist() == [[2.0, 2.0]] * 3
    failure = outcomes["odd"]
    assert isinstance(failure, StepFailed)
    assert list(exchange_root().glob(f"{os.getpid()}-*")) == []
    return failure.kind, failure.reason


def test_it_answers_as_in_this_process_and_stays_loaded(apart: Path) -> None:
    with peak_memory() as peak, predictor("doubler") as predict:
        there = [predict(QUESTION) for _ in range(3)]
        pid = int(predict(Question(QUESTION.values, "pid")).noise)
    assert loads(apart) == 1
    assert pid != os.getpid()
    assert peak.mb > process_rss(os.getpid()) / 1e6 + 10, "the worker's memory is the step's"
    settings()
    with predictor("doubler") as predict:
        here = predict(QUESTION)
    for answer in there:
        assert np.array_equal(answer.values, here.values)
        assert answer.noise == here.noise
        assert [p.note for p in answer.parts] == ["upright"]
    wait_for(lambda: not alive(pid))


@pytest.mark.parametrize(
    ("how", "kind", "said"),
    [
        ("die", "ModelFailed", "doubler: its process was ended by SIGKILL; .*the driver gave up"),
        ("leave", "ModelFailed", "doubler: its process ended with code 7 and no result; .*no more"),
        ("bad", "BadInput", "^the question is bad: ask another one$"),
        ("memory", "ModelOutOfMemory", "doubler does not fit into the memory of cpu: no room"),
        ("gpu memory", "ModelOutOfMemory", "of cpu: CUDA out of memory$"),
        ("bug", "ModelFailed", "doubler raised ZeroDivisionError: by nothing, and no secret here"),
        ("wrong type", "ModelFailed", "doubler answered nothing usable: .*Part, expected Answer"),
        ("no noun", "ModelFailed", "doubler answered nothing usable: it is a dict, expected"),
        ("unwritable", "ModelFailed", "doubler: noise is a object: store dataclasses"),
        ("nan", "ModelFailed", r"1 of 16 numbers of Answer.parts\[1\].pose are not finite"),
        ("infinite", "ModelFailed", "doubler gave an answer that cannot be: Answer.noise is inf"),
        ("wrong shape", "ModelFailed", r"Answer.values is float64 \[2, 3\], not Float"),
        ("too few", "ModelFailed", r"Answer.values is float64 \[2, 2\], not Float"),
        ("wrong dtype", "ModelFailed", r"Answer.values is int64 \[3, 2\], not Float"),
        ("objects", "ModelFailed", "doubler: arrays of object cannot be stored"),
    ],
)
def test_what_goes_wrong_costs_one_step_and_is_told(
    apart: Path, store: Store, monkeypatch: pytest.MonkeyPatch, how: str, kind: str, said: str
) -> None:
    monkeypatch.setenv("HIDDEN_TOKEN", "hunter2-hunter2")
    failed_kind, failed_reason = reason(store, how)
    assert failed_kind == kind
    assert re.search(said, failed_reason, re.DOTALL), failed_reason


@pytest.mark.parametrize("how", ["bad", "memory", "bug", "nan"])
def test_a_worker_that_can_go_on_is_not_loaded_again(apart: Path, store: Store, how: str) -> None:
    run(store, odd=how)
    assert loads(apart) == 1


@pytest.mark.parametrize("how", ["die", "leave"])
def test_after_a_crash_the_next_question_starts_another_one(
    apart: Path, store: Store, how: str
) -> None:
    run(store, odd=how)
    assert loads(apart) == 2


@pytest.mark.slow
def test_a_hang_ends_at_the_time_limit_with_all_that_it_started(apart: Path, store: Store) -> None:
    settings(python=sys.executable, time_limit_s=4)
    kind, said = reason(store, "hang")
    assert kind == "ModelFailed"
    assert "doubler: its worker was stopped after 4 s, its time limit" in said
    child = re.search(r"child (\d+)", said)
    assert child is not None
    wait_for(lambda: not alive(int(child[1])))


@pytest.mark.slow
def test_the_memory_limit_holds_and_can_be_reacted_to(apart: Path, store: Store) -> None:
    settings(python=sys.executable, time_limit_s=60, memory_limit_gb=0.5)
    kind, said = reason(store, "hoard")
    assert kind == "ModelOutOfMemory"
    assert "above its memory limit of 0.5 GB" in said
    with predictor("doubler") as predict:
        with pytest.raises(ModelOutOfMemory):
            predict(Question(np.ones((8, 2)), "hoard"))
        assert predict(Question(np.ones((4, 2)))).values.shape == (4, 2)


QUICK = {"version", "garbage", "other question", "changed member", "other noun"}


def slow_but(how: str) -> list[pytest.MarkDecorator]:
    return [] if how in QUICK else [pytest.mark.slow]


LIES = {
    "version": "speaks garden.worker/99, and this GARDEN garden.worker/1",
    "greeting": "does not keep to the protocol: it wrote hello, I am a program",
    "list": "does not keep to the protocol: it wrote [1, 2]",
    "no number loaded": "tells 'nan' as seconds",
    "progress": "does not keep to the protocol: it wrote could not convert string to float",
    "garbage": "does not keep to the protocol: it wrote Segmentation fault (not really)",
    "flood": "does not keep to the protocol: it wrote a line of more than 8 MB",
    "unknown word": 'does not keep to the protocol: it wrote {"maybe": {}}',
    "other question": "answered another question than it was asked",
    "no number": "tells 'a while' as seconds",
    "bad error": "does not keep to the protocol: it wrote",
    "missing member": "the member 0000.npy is missing",
    "unlisted member": "the member 0000.npy is not listed",
    "changed member": "the member 0000.npy is not what was written",
    "member outside": "'../../secret' is no name of a member",
    "linked member": "the member 0000.npy is missing",
    "missing field": "the stored Answer lacks the field 'noise'",
    "other noun": "the stored value is a Part, expected Answer",
    "no tree": "it is a int, expected a Answer",
    "other payload": "tree.json is no garden.payload/1",
    "other digest": "tree.json is not the one that was announced",
    "no array": "the member 0000.npy is no array",
}


@pytest.mark.parametrize("how", [pytest.param(how, marks=slow_but(how)) for how in LIES])
def test_a_worker_that_lies_is_found_out(models: Path, store: Store, how: str) -> None:
    settings(python=[sys.executable, liar.__file__, how], time_limit_s=60)
    with run_context(RunContext(store, "room", workers=1)):
        good, failure, late = fan_out(partial(ask, config=Asking(others="tripler")), TARGETS)
    assert isinstance(failure, StepFailed)
    assert failure.kind == "ModelFailed"
    assert failure.reason.startswith("doubler")
    assert LIES[how] in failure.reason
    for ref in (good, late):
        assert isinstance(ref, Ref)
        assert store.read(ref.object, Answer).values.tolist() == [[3.0, 3.0]] * 3


def test_a_step_tells_what_its_model_does_and_goes_no_step_back(
    apart: Path, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compute, "_PROGRESS_EVERY_S", 0.0)
    events: list[StepEvent] = []
    with run_context(RunContext(store, "room", events=events.append)):
        ask(TARGETS[0], Asking())
    told = [(e.share, e.doing) for e in events if e.kind == "progress"]
    assert told == [
        (0.5, "thinking of a question"),
        (0.5, "loading doubler"),
        (0.5, "running doubler"),
    ]


def test_an_interpreter_that_is_not_there_is_named(models: Path) -> None:
    settings(python="/nowhere/bin/python")
    with (
        predictor("doubler") as predict,
        pytest.raises(ModelFailed, match=r"/nowhere/bin/python could not .*: correct doubler.pyth"),
    ):
        predict(QUESTION)


def test_what_it_prints_is_in_our_log_without_secrets(
    apart: Path, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HIDDEN_TOKEN", "hunter2-hunter2")
    run(store, odd="say secret")
    text = log_file().read_text()
    assert "garden.model.doubler I was started with []" in text
    assert "and somebody told me ***" in text
    assert "hunter2" not in text


def test_its_memory_is_given_back_when_another_model_is_asked(apart: Path) -> None:
    with predictor("doubler") as predict:
        pid = int(predict(Question(QUESTION.values, "pid")).noise)
    with predictor("tripler") as predict:
        predict(QUESTION)
    wait_for(lambda: not alive(pid))


PARENT = """
import sys
import numpy as np
from tasks.model import predictor
from tests.tasks.model.nouns import Question
from tests.tasks.model.registered import register_if_told
register_if_told()
with predictor("doubler") as predict:
    print(int(predict(Question(np.ones((1, 2)), "pid")).noise), flush=True)
    predict(Question(np.ones((1, 2)), "hang"))
"""


@pytest.mark.slow
def test_it_dies_with_its_parent(apart: Path) -> None:
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        stdout=subprocess.PIPE,
    )
    try:
        assert parent.stdout is not None
        worker = int(parent.stdout.readline())
        assert alive(worker)
        time.sleep(0.2)
        parent.kill()
        wait_for(lambda: not alive(worker))
    finally:
        parent.kill()


def test_a_stopped_run_ends_the_question_and_the_worker(
    apart: Path, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compute, "_PROGRESS_EVERY_S", 0.0)
    pids: list[int] = []
    with predictor("doubler") as predict:
        pids.append(int(predict(Question(QUESTION.values, "pid")).noise))

    def listen(event: StepEvent) -> None:
        if event.doing == "running doubler":
            context.cancelled.set()

    context = RunContext(store, "room", events=listen)
    with run_context(context), pytest.raises(StepFailed) as caught:
        ask(TARGETS[0], Asking(how=(("good", "hang"),)))
    assert caught.value.kind == "Cancelled"
    wait_for(lambda: not alive(pids[0]))
    assert residents.loads > 0
