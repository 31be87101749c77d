"""Jobs for the tests of passes: scenes that ask one model, then another, and note what ran."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flows.collection.job import JobOrder, JobRun, Report
from garden_models.scene import BadInput
from storage import Store
from tasks.model import predictor, weights_of
from tasks.step import Postponed, Ref, RunContext, fan_out, run_context, step
from tests.tasks.model.nouns import Answer, Question
from tests.tasks.model.registered import MODELS, register_if_told

STOPS = ("triple",)

register_if_told()


def _note(log: str, what: str) -> None:
    with Path(log).open("a") as file:
        file.write(f"{what}\n")


def _ask(model: str, values: np.ndarray) -> Answer:
    with predictor(model) as predict:
        answer: Answer = predict(Question(values))
    return answer


@step(version=1, weights=lambda **_: weights_of("doubler"), skip=("log",), memory_gb=0.5)
def double(scene: str, number: int, log: str) -> Answer:
    _note(log, f"double {scene}")
    return _ask("doubler", np.full((1, 2), float(number)))


@step(version=1, weights=lambda **_: weights_of("tripler"), skip=("log",), memory_gb=0.5)
def triple(scene: str, target: int, doubled: Answer, log: str) -> Answer:
    _note(log, f"triple {scene} {target}")
    return _ask("tripler", doubled.values + target)


@step(version=1, skip=("log",), memory_gb=0.5)
def finish(scene: str, tripled: tuple[Answer, ...], log: str) -> Answer:
    _note(log, f"finish {scene}")
    return Answer(np.concatenate([t.values for t in tripled]), 0.0)


@dataclass(frozen=True)
class ModelJob:
    """A scene of four steps; its second and third ask the second model."""

    name: str
    number: int
    log: str
    does: str = ""

    def plan(self, store: Store) -> Report | None:
        if self.does == "fails early":
            return None
        context = RunContext(store, self.name, "plan")
        with run_context(context):
            self._steps()
        finished = all(entry.action == "cached" for entry in context.plan)
        return self._report(0, len(context.plan)) if finished else None

    def run(self, store: Store, events: JobRun) -> Report:
        context = RunContext(
            store, self.name, "local", events, budget=events.budget, postponed=events.postponed
        )
        with run_context(context):
            try:
                self._steps()
            except Postponed as postponed:
                return {"postponed": postponed.step}
        if self.does == "fails late":
            raise BadInput("the last step of this scene went wrong")
        executed = sum(event.outcome == "executed" for event in context.outcomes)
        return self._report(executed, len(context.outcomes) - executed)

    def _steps(self) -> None:
        doubled = double(self.name, self.number, self.log)
        if self.does == "fails early":
            raise BadInput("the photos of this scene show nothing")

        def one(target: int) -> Ref:
            return triple(self.name, target, doubled, self.log)

        tripled = fan_out(one, (1, 2))
        for outcome in tripled:
            if isinstance(outcome, Exception):
                raise outcome
        finish(self.name, tuple(tripled), self.log)

    def _report(self, executed: int, cached: int) -> Report:
        return {"status": "ok", "reasons": [], "executed": executed, "cached": cached}


def model_job(**arguments: Any) -> ModelJob:
    return ModelJob(**arguments)


def orders(home: Path, stops: tuple[str, ...] = STOPS, **does: str) -> list[JobOrder]:
    return [
        JobOrder(
            name,
            "tests.flows.collection.model_job:model_job",
            {"name": name, "number": number, "log": str(home / "ran.log"), "does": what},
            models=tuple(MODELS),
            stops=stops,
        )
        for number, (name, what) in enumerate(does.items())
    ]
