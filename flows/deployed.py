"""The flow that a Prefect deployment runs on a worker: one capture to its package."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from prefect import flow

from flows.command.scene_options import add_scene_options, scene_request, store_address
from flows.package.write import refresh_report, write_scene_package
from flows.scene_run import is_finished, plan_scene, run_scene
from storage import Store
from storage.redact import without_secrets


@flow(name="factorize-capture", flow_run_name="{capture}", persist_result=False)
@without_secrets()
def factorize_capture(
    capture: str, out: str = "scenes", store: str | None = None, arguments: tuple[str, ...] = ()
) -> dict[str, Any]:
    """Factorize a capture on this worker; return where its package is and its verdict.

    ``arguments`` are further options as ``garden factorize`` takes them. Raises
    RuntimeError for a scene that failed, so that the flow run shows as failed; its package
    and all that was computed stay.
    """
    parser = argparse.ArgumentParser()
    add_scene_options(parser)
    request = scene_request(parser.parse_args([capture, "--out", out, *arguments]))
    artifacts = Store.open(store_address(store))
    planned, plan = plan_scene(request, artifacts)
    if is_finished(plan, planned):
        report = refresh_report(planned)
    else:
        report = write_scene_package(run_scene(request, artifacts, lambda _: None), artifacts)
    if report["status"] == "failed":
        raise RuntimeError("; ".join(report["reasons"]))
    return {
        "package": str(Path(request.package).resolve()),
        "status": report["status"],
        "reasons": report["reasons"],
        "executed": report["executed"],
    }
