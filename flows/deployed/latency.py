"""The flow that a Prefect deployment runs on a worker: the latency report, e.g. every week."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from prefect import flow
from prefect.states import State

from flows.benchmark.latency.report import LatencyOptions, write_latency_report
from flows.command.store_option import store_address
from flows.deployed.verdict_state import verdict_state
from flows.wrong_use import WrongUse
from garden_models.scene import BadInput
from storage import StoreMissing
from storage.formats.errors import UnreadableInput
from storage.redact import without_secrets

FOLDER = "latency"


@flow(name="latency-report", flow_run_name="{collection}", persist_result=False)
@without_secrets()
def latency_report(
    collection: str, out: str = "scenes", store: str | None = None, measure: bool = False
) -> State[Any]:
    """Write the latency report of a collection to ``out/latency``; its state tells where it is.

    Without ``measure`` it is read from the store, which nothing slows down; with it every
    scene is run cold, cached and warm with a store of its own, which takes as long as that.
    ``out`` is also where the scenes' packages are. What the report cannot show is the state's
    message.
    """
    folder = Path(out) / FOLDER
    options = LatencyOptions(execute=measure, packages=Path(out))
    try:
        document = write_latency_report([collection], folder, store_address(store), options)
    except (WrongUse, BadInput, UnreadableInput, StoreMissing) as error:
        return verdict_state("failed", [str(error)], {})
    report = str((folder / "latency.html").resolve())
    return verdict_state(document["status"], document["absent"], {"report": report})
