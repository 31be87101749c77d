"""Flows for the tests of pools, schedules and automations: quick, and out of real steps."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path

from prefect import flow

from storage import Store
from tasks.step import RunContext, run_context
from tests.tasks.step.toy import Scaling, make, scale


@flow(name="toy-collection", persist_result=False)
def toy_collection(asked: str) -> None:
    """Run two steps as the file ``asked`` says, with the worker's store."""
    wish = json.loads(Path(asked).read_text())
    store = Store.open(os.environ["GARDEN_STORE"], durability="none")
    with run_context(RunContext(store, "room", "prefect")):
        scale(make(wish["count"]), Scaling(wish["factor"]))


@flow(name="toy-wait", persist_result=False)
def toy_wait(seconds: float) -> None:
    """Take some time."""
    time.sleep(seconds)


@flow(name="toy-many", persist_result=False)
def toy_many(count: int, store: str) -> None:
    """Run ``count`` steps."""
    with run_context(RunContext(Store.open(store, durability="none"), "room", "prefect")):
        for number in range(count):
            make(number + 1)
