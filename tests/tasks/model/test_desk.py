"""The places of a machine: a model goes when nobody asks it, and a GPU's slot goes with it."""

from __future__ import annotations

import dataclasses
import os
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from garden_models.scene import BadInput
from tasks.model.desk import Desk, Question, _gpus_of
from tasks.model.exchange import exchange
from tasks.model.launch import Launch, launch_of
from tasks.model_worker import protocol
from tasks.model_worker.payload import read_payload, write_payload
from tasks.step import Budget
from tasks.step.slots import Ticket
from tests.tasks.model import nouns
from tests.tasks.model.test_worker import settings
from tests.tasks.step.test_isolate import alive, wait_for

GPU = "7"


@pytest.fixture
def budget(tmp_path: Path) -> Budget:
    (tmp_path / "slots").mkdir()
    return Budget((0, 1), 4.0, (GPU,), tmp_path / "slots")


@pytest.fixture
def open_desk(budget: Budget) -> Iterator[Callable[..., Desk]]:
    desks: list[Desk] = []

    def make(idle_s: float = 60.0) -> Desk:
        desks.append(Desk(budget, idle_s=idle_s))
        return desks[-1]

    yield make
    for desk in desks:
        desk.close()


def ask(desk: Desk, launch: Launch, how: str = "") -> float:
    with exchange() as folder:
        request = nouns.Question(np.ones((1, 2)), how)
        digest = write_payload(request, folder / protocol.REQUEST_FOLDER)
        question = Question(launch, folder, digest, lambda _s, _d: None, threading.Event())
        desk.put(question)
        assert question.done.wait(60)
        if isinstance(question.outcome, Exception):
            raise question.outcome
        assert question.outcome is not None
        told = question.outcome["digest"]
        answer = read_payload(folder / protocol.ANSWER_FOLDER, told, nouns.Answer)
        return float(answer.noise)


def slot_is_free(budget: Budget) -> bool:
    ticket = Ticket(budget.folder, {"gpu": 1}, {"gpu": budget.gpus})
    try:
        return ticket.try_take()
    finally:
        ticket.give_back()


def test_a_model_that_nobody_asks_is_let_go(models: Path, open_desk: Callable[..., Desk]) -> None:
    desk = open_desk(idle_s=0.3)
    pid = int(ask(desk, launch_of("doubler"), "pid"))
    wait_for(lambda: not alive(pid))
    assert int(ask(desk, launch_of("doubler"), "pid")) != pid
    assert desk.tally.to_json()["doubler"]["loads"] == 2


def test_a_gpus_slot_is_held_while_a_model_is_on_it(
    models: Path,
    open_desk: Callable[..., Desk],
    budget: Budget,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", GPU)
    settings(device="cuda")
    desk = open_desk(idle_s=0.5)
    launch = launch_of("doubler")
    assert launch.device == "cuda"
    assert slot_is_free(budget)
    pid = int(ask(desk, launch, "pid"))
    assert pid != os.getpid()
    assert not slot_is_free(budget)
    assert (models / "doubler/loads.txt").read_text() == f"cuda {GPU}\n"
    wait_for(lambda: slot_is_free(budget))
    assert not alive(pid)


def test_two_keepers_do_not_share_a_gpu(
    models: Path,
    open_desk: Callable[..., Desk],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", GPU)
    settings(device="cuda")
    first, second = open_desk(idle_s=0.5), open_desk()
    pid = int(ask(first, launch_of("doubler"), "pid"))
    assert int(ask(second, launch_of("doubler"), "pid")) != pid
    assert not alive(pid)


def test_an_error_leaves_the_place_to_others(models: Path, open_desk: Callable[..., Desk]) -> None:
    desk = open_desk()
    with pytest.raises(BadInput):
        ask(desk, launch_of("doubler"), "bad")
    ask(desk, launch_of("tripler"))
    cost = desk.tally.to_json()
    assert (cost["doubler"]["calls"], cost["doubler"]["failures"]) == (0, 1)
    assert (cost["tripler"]["calls"], cost["tripler"]["loads"]) == (1, 1)


def test_a_run_that_may_use_no_gpu_is_told(
    models: Path, budget: Budget, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", GPU)
    settings(device="cuda")
    desk = Desk(dataclasses.replace(budget, gpus=()))
    with pytest.raises(BadInput, match="doubler runs on a GPU, and this run may use none"):
        ask(desk, launch_of("doubler"))
    desk.close()


@pytest.mark.parametrize(
    ("device", "places"),
    [
        ("cpu", [()]),
        ("cuda", [("4", "6"), ("4", "6")]),
        ("cuda:1", [("6",)]),
    ],
)
def test_each_gpu_is_a_place(device: str, places: list[tuple[str, ...]]) -> None:
    assert _gpus_of(device, ("4", "6")) == places
