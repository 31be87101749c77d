"""Steps that ask the test models."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from garden_models.progress import Progress, silent
from garden_models.scene import Target
from tasks.model import backend_of, predictor, weights_of
from tasks.step import step
from tests.tasks.model.nouns import Answer, Question
from tests.tasks.model.registered import register_if_told

register_if_told()


@dataclass(frozen=True)
class Asking:
    """How a target's question is meant, and which model the target ``odd`` asks."""

    how: tuple[tuple[str, str], ...] = ()
    odd: str = "doubler"
    others: str = "doubler"

    def of(self, target: Target) -> str:
        return dict(self.how).get(target.name, "")

    def model(self, target: Target) -> str:
        return self.odd if target.name == "odd" else self.others


def _backend(target: Target, config: Asking) -> str:
    return backend_of(config.model(target))


def _weights(target: Target, config: Asking) -> dict[str, str]:
    return weights_of(config.model(target))


def _ask(target: Target, config: Asking, progress: Progress = silent) -> Answer:
    with predictor(config.model(target), progress) as predict:
        answer: Answer = predict(Question(np.ones((3, 2)), config.of(target)))
    return answer


@step(version=1, backend=_backend, weights=_weights, retries=0)
def ask(target: Target, config: Asking, progress: Progress = silent) -> Answer:
    progress(0.5, "thinking of a question")
    return _ask(target, config, progress)


@step(version=1, backend=_backend, weights=_weights, isolated=True, retries=0, time_limit_s=6)
def ask_apart(target: Target, config: Asking) -> Answer:
    return _ask(target, config)


TARGETS = tuple(Target(name, "a.jpg", (0.0, 0.0, 1.0, 1.0)) for name in ("good", "odd", "late"))
