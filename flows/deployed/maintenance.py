"""The flow that a Prefect deployment runs on a worker: keep the store sound and small."""

from __future__ import annotations

from typing import Any, Literal

from prefect import flow
from prefect.states import State

from flows.command.store_option import store_address
from flows.deployed.verdict_state import verdict_state
from storage import Store, StoreMissing
from storage.redact import without_secrets

GB = 1e9
HOUR_S = 3600.0
NAMED = 10
"""Problems that a flow run's message names; ``garden store verify`` tells of all."""


@flow(name="maintain-store", persist_result=False)
@without_secrets()
def maintain_store(
    store: str | None = None,
    quota_gb: float | None = None,
    grace_hours: float = 24.0,
    level: Literal["manifest", "full"] = "full",
) -> State[Any]:
    """Verify the store, remove what nothing needs and write its catalogue anew.

    Args:
        store: its folder or bucket; what the worker's ``GARDEN_STORE`` says if not given.
        quota_gb: what all artifacts may take; the longest unused go first.
        grace_hours: what was made or used within so many hours stays.
        level: ``full`` reads every byte, ``manifest`` compares lists and sizes.

    Returns the state Degraded if something is damaged: nothing is repaired unasked, and a
    damaged artifact is computed again when it is needed.
    """
    try:
        artifacts = Store.open(store_address(store), create=False)
    except StoreMissing as error:
        return verdict_state("failed", [str(error)], {})
    problems = artifacts.verify(level)
    quota_bytes = None if quota_gb is None else int(quota_gb * GB)
    collected = artifacts.collect(quota_bytes=quota_bytes, grace_s=grace_hours * HOUR_S)
    rows = artifacts.compact()
    summary = {
        "problems": len(problems),
        "forgotten": len(collected.forgotten),
        "removed": collected.objects,
        "freed_bytes": collected.freed_bytes,
        "bytes": collected.bytes_left,
        "catalogue_rows": rows,
    }
    done = (
        f"{collected.objects} artifacts removed, {collected.freed_bytes / GB:.1f} GB freed,"
        f" {collected.bytes_left / GB:.1f} GB left"
    )
    if not problems:
        return verdict_state("ok", [done], summary)
    found = f"{len(problems)} problems: see `garden store verify`, then `garden store repair`"
    return verdict_state("degraded", [found, *map(str, problems[:NAMED]), done], summary)
