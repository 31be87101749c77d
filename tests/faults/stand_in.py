"""Run the real flow, plan and keys with computations that cost nothing, on order.

    python -m tests.faults.stand_in < one JSON order a line > one JSON answer a line

Photos are taken in for real. Every other step gives a small value of its noun that holds
the digests of its inputs, so that it changes exactly when they do; those that an order
names as ``steady`` give the same always. ``PYTHONPATH`` says which copy of the packages is
meant: their sources may be edited between two orders, as keys are made from the sources.
"""

from __future__ import annotations

import argparse
import dataclasses
import importlib
import json
import os
import pkgutil
import sys
from collections.abc import Callable
from typing import Any

import tasks
from flows.command.scene_options import add_scene_options, scene_request
from flows.factorize import SceneRefs, factorize_scene
from flows.scene_run import SceneRequest, plan_scene
from garden_models.scene import Verdict
from storage import Store
from storage.codec.content import content_digest
from tasks.step import RunContext, Step, run_context
from tasks.step.code import forget_code
from tests.tasks.step.test_nouns_stored import build

steady: set[str] = set()


def all_steps() -> dict[str, Step]:
    """Return every step that a module of ``tasks`` defines, by name."""
    found = {}
    for module in pkgutil.iter_modules(tasks.__path__):
        if module.name != "step":
            contents = vars(importlib.import_module(f"tasks.{module.name}"))
            found |= {s.name: s for s in contents.values() if isinstance(s, Step)}
    return found


def replace_computations(steps: dict[str, Step]) -> None:
    """Let every step but ``ingest`` give a sample of its noun."""
    for step in steps.values():
        if step.name == "ingest":
            continue
        step.hints()
        step.spec = dataclasses.replace(step.spec, isolated=False, packages=step.spec.packages)
        step.fn = sample_of(step, step.hints()["return"])


def sample_of(step: Step, noun: Any) -> Callable[..., Any]:
    """Return a function that stands for ``step``; its module, and so its key, is the step's."""

    def give(**arguments: Any) -> Any:
        arguments.pop("progress", None)
        inputs = "steady"
        if step.name not in steady:
            inputs = " ".join(content_digest(v) for _, v in sorted(arguments.items()))
        if "verdict" not in {f.name for f in dataclasses.fields(noun)}:
            return noun()
        return dataclasses.replace(build(noun, 2), verdict=Verdict("ok", (inputs,)))

    give.__module__ = step.fn.__module__
    give.__qualname__ = step.fn.__qualname__
    return give


def request(order: dict[str, Any]) -> SceneRequest:
    """Return the scene that ``garden factorize`` would make of the order's arguments."""
    parser = argparse.ArgumentParser()
    add_scene_options(parser)
    return scene_request(parser.parse_args(order["arguments"]))


def run(order: dict[str, Any]) -> list[dict[str, Any]]:
    """Run a scene; return what became of each step."""
    steady.clear()
    steady.update(order.get("steady", ()))
    wanted = request(order)
    store = Store.open(order["store"], durability="none")
    context = RunContext(store, wanted.name, isolate=False, workers=1)
    with run_context(context):
        factorize_scene(wanted.source, wanted.targets, wanted.preset, SceneRefs(wanted.targets))
    return [
        {"step": e.step, "label": e.label, "did": e.outcome, "why": e.why, "ref": e.ref}
        for e in context.outcomes
    ]


def plan(order: dict[str, Any]) -> list[dict[str, Any]]:
    """Return what ``garden plan`` would say."""
    entries = plan_scene(request(order), Store.open(order["store"], durability="none"))[1]
    return [
        {"step": e.step, "label": e.label, "did": e.action, "why": e.why, "ref": e.ref}
        for e in entries
    ]


def digests(order: dict[str, Any]) -> dict[str, Any]:
    """Return every step's code digest and the modules it is made from."""
    return {
        name: {"digest": step.code().digest, "modules": sorted(step.code().modules)}
        for name, step in all_steps().items()
    }


def imitate_another_machine() -> None:
    """Change what a machine is told by; ``GARDEN_TEST_MACHINE`` names it."""
    name = os.environ.get("GARDEN_TEST_MACHINE")
    if not name:
        return
    import platform
    import socket
    import time

    socket.gethostname = lambda: name
    platform.node = lambda: name
    os.cpu_count = lambda: 61
    os.sched_getaffinity = lambda _pid: set(range(61))  # type: ignore[attr-defined]
    time.time_ns = lambda: 7


def main() -> None:
    """Answer orders until there are no more."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what libraries print is no answer
    imitate_another_machine()
    replace_computations(all_steps())
    for line in sys.stdin:
        forget_code()
        order = json.loads(line)
        answer = {"run": run, "plan": plan, "digests": digests}[order["do"]](order)
        answers.write(json.dumps(answer, default=dataclasses.asdict) + "\n")
        answers.flush()


if __name__ == "__main__":
    main()
