"""A model in this process: loaded once, one a device, the same answer each time."""

from __future__ import annotations

import dataclasses
import gc
import random
import weakref
from pathlib import Path

import numpy as np
import pytest
import torch

from garden_models.foundation.failure import ModelOutOfMemory
from garden_models.scene import BadInput
from tasks.model import predictor
from tasks.model.resident import LoadedElsewhere, LoadedHere, residents
from tasks.model_worker.calling import call
from tests.tasks.model import doubler
from tests.tasks.model.doubler import loads, put_weights
from tests.tasks.model.nouns import Answer, Ask, Part, Question

QUESTION = Question(np.ones((3, 2)))


def test_it_answers_and_stays_loaded(models: Path) -> None:
    for _ in range(2):
        with predictor("doubler") as predict:
            assert predict(QUESTION).values.tolist() == [[2.0, 2.0]] * 3
            predict(QUESTION)
    assert loads(models / "doubler") == 1


def test_what_is_missing_is_told_before_anything_is_asked(models: Path) -> None:
    (models / "doubler/factor.txt").unlink()
    with pytest.raises(BadInput, match=r"put them at .*doubler/factor\.txt"), predictor("doubler"):
        raise AssertionError
    with pytest.raises(BadInput, match="no model is called 'nobody'"), predictor("nobody"):
        raise AssertionError


def test_another_model_takes_its_place_on_the_device(models: Path) -> None:
    with predictor("doubler") as double:
        double(QUESTION)
        place = residents._places["cpu"]
        loaded = place.loaded
        assert isinstance(loaded, LoadedHere)
        gone = weakref.ref(loaded._predict)  # type: ignore[arg-type]
        del loaded
        with predictor("tripler") as triple:
            assert triple(QUESTION).values[0, 0] == 3.0
            gc.collect()
            assert gone() is None
            assert double(QUESTION).values[0, 0] == 2.0
    assert (loads(models / "doubler"), loads(models / "tripler")) == (2, 1)


def test_one_that_changes_its_process_gets_one_of_its_own(
    models: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(doubler, "CARD", dataclasses.replace(doubler.CARD, own_process=True))
    with predictor("doubler") as predict:
        assert predict(QUESTION).values.tolist() == [[2.0, 2.0]] * 3
    assert isinstance(residents._places["cpu"].loaded, LoadedElsewhere)


def test_replaced_weights_are_loaded(models: Path) -> None:
    with predictor("doubler") as predict:
        predict(QUESTION)
    put_weights(models / "doubler", 5.25)
    with predictor("doubler") as predict:
        assert predict(QUESTION).values[0, 0] == 5.25


def test_the_same_question_has_the_same_answer_and_disturbs_nobody(models: Path) -> None:
    with predictor("doubler") as predict:
        random.seed(5), np.random.seed(5), torch.manual_seed(5)
        first = predict(QUESTION).noise
        after = random.random(), float(np.random.uniform()), float(torch.rand(1))
        assert predict(QUESTION).noise == first
        assert predict(Question(QUESTION.values, seed=1)).noise != first
    random.seed(5), np.random.seed(5), torch.manual_seed(5)
    assert after == (random.random(), float(np.random.uniform()), float(torch.rand(1)))


def test_a_call_keeps_no_gradients_and_runs_at_its_dtype() -> None:
    weight = torch.nn.Linear(4, 4)
    seen: list[torch.Tensor] = []

    def predict(question: Question) -> Answer:
        seen.append(weight(torch.ones(1, 4)))
        return Answer(question.values, float(torch.rand(1)), (Part(np.eye(4)),))

    answers = [call(predict, QUESTION, "m", "cpu", dtype) for dtype in ("float32", "bfloat16")]
    assert [out.dtype for out in seen] == [torch.float32, torch.bfloat16]
    assert all(out.is_inference() for out in seen)
    assert answers[0].noise == answers[1].noise


@pytest.mark.parametrize("error", [MemoryError("full"), torch.OutOfMemoryError("full")])
def test_every_kind_of_full_memory_is_one_error(error: Exception) -> None:
    def predict(_question: Question) -> Answer:
        raise error

    with pytest.raises(ModelOutOfMemory, match="m does not fit into the memory of cpu: full"):
        call(predict, QUESTION, "m", "cpu", "float32")


def test_a_model_that_does_not_fit_leaves_nothing_behind(
    models: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def load(_weights: Path, _device: str) -> Ask:
        raise MemoryError

    with predictor("doubler") as predict:
        predict(QUESTION)
        monkeypatch.setattr("tests.tasks.model.tripler.load", load)
        with predictor("tripler") as triple, pytest.raises(ModelOutOfMemory, match="tripler"):
            triple(QUESTION)
        assert residents._places["cpu"].loaded is None
        assert predict(QUESTION).values[0, 0] == 2.0
