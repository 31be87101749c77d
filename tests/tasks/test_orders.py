"""Every step of the pipeline can be sent elsewhere: its plain arguments survive as JSON."""

from __future__ import annotations

import dataclasses
import importlib
import json
import pkgutil
import typing
from typing import Any

import pytest

import tasks
from garden_models.scene import Target
from storage.canonical import canonical
from tasks.step import Step
from tasks.step.wire import plain_from_json, plain_to_json

MODULES = [name for _f, name, is_package in pkgutil.iter_modules(tasks.__path__) if not is_package]
STEPS = [
    found
    for name in MODULES
    for found in vars(importlib.import_module(f"tasks.{name}")).values()
    if isinstance(found, Step) and found.__module__ == f"tasks.{name}"
]


def sample(hint: Any) -> Any:
    if hint is Target:
        return Target("mug", "a.jpg", (1.0, 2.0, 3.5, 4.0))
    if typing.get_origin(hint) is tuple:
        return (sample(typing.get_args(hint)[0]),) * 2
    if dataclasses.is_dataclass(hint):
        return hint()
    if typing.get_origin(hint) is typing.Literal:
        return typing.get_args(hint)[0]
    return {str: "a.jpg", int: 3, float: 0.5, bool: True}[hint]


def is_plain(name: str, hint: Any) -> bool:
    nouns = [part for part in (hint, *typing.get_args(hint)) if hasattr(part, "SCHEMA")]
    return name not in ("progress", "return") and not nouns


def test_there_are_steps() -> None:
    assert len(STEPS) >= 12


@pytest.mark.parametrize("step", [s for s in STEPS if not s.spec.here], ids=lambda s: s.name)
def test_plain_arguments_survive(step: Step) -> None:
    for name, hint in step.hints().items():
        if not is_plain(name, hint):
            continue
        value = sample(hint)
        again = plain_from_json(json.loads(json.dumps(plain_to_json(value))), hint)
        assert type(again) is type(value)
        assert canonical(again, domain="t") == canonical(value, domain="t")


def test_what_reads_the_users_files_or_keys_stays_where_they_are() -> None:
    here = {step.name for step in STEPS if step.spec.here}
    assert here == {"ingest", "extract_gravity_tokens", "propose_targets", "check_targets"}
