"""The flow that a Prefect deployment runs on a worker: a whole collection, e.g. every night."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from prefect import flow
from prefect.states import State

from flows.collection.definition import read_collection
from flows.collection.row import SceneRow
from flows.collection.run import run_collection
from flows.command.store_option import store_address
from flows.deployed.verdict_state import verdict_state
from flows.step_runner import Runner
from flows.wrong_use import WrongUse
from garden_models.scene import BadInput
from storage.redact import without_secrets

NAMED = 10
"""Scenes that a flow run's message names; the collection's page tells of all."""


@flow(name="factorize-collection", flow_run_name="{collection}", persist_result=False)
@without_secrets()
def factorize_collection(
    collection: str,
    out: str | None = None,
    store: str | None = None,
    only: tuple[str, ...] = (),
    runner: str | None = None,
    shared_store: bool = False,
) -> State[Any]:
    """Bring every scene of a collection up to date; its state tells which are not ok, and why.

    ``collection`` is a TOML or YAML file or a folder of captures on this worker, ``out`` where
    packages go (what the file says), ``only`` the scenes to run, or ``failed`` for those that
    failed the last time; ``runner`` and ``shared_store`` are those of ``garden batch``. What
    the store holds is not executed again. A scene that fails stops no other; the flow run
    ends as failed.
    """
    try:
        scenes = read_collection(Path(collection), out=Path(out) if out else None)
        elsewhere = Runner(runner, shared_store)
        result = run_collection(scenes, store_address(store), only=only, runner=elsewhere)
    except (WrongUse, BadInput) as error:
        return verdict_state("failed", [str(error)], {})
    summary = {
        "out": str(scenes.out.resolve()),
        "status": result.status,
        "scenes": {row.name: row.status for row in result.rows},
        "executed": sum(row.executed for row in result.rows),
    }
    return verdict_state(result.status, not_ok(result.rows), summary)


def not_ok(rows: Sequence[SceneRow]) -> list[str]:
    """Tell which scenes failed or are degraded, and why: failed ones first, ten at most."""
    said = []
    for status in ("failed", "degraded"):
        found = [row for row in rows if row.status == status]
        if found:
            said.append(f"{len(found)} of {len(rows)} scenes {status}")
            room = max(0, NAMED - len(said))
            said += [f"{row.name}: {', '.join(row.reasons)}" for row in found[:room]]
    return said
