"""The flow that a Prefect deployment runs on a worker: one capture to its package."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, NoReturn

from prefect import flow
from prefect.states import State

from flows.command.scene_options import add_scene_options, scene_request
from flows.command.store_option import store_address
from flows.deployed.verdict_state import verdict_state
from flows.package.write import refresh_report, write_scene_package
from flows.scene_run import is_finished, plan_scene, run_scene
from flows.step_runner import step_runner
from flows.wrong_use import WrongUse
from garden_models.scene import BadInput
from storage import Store
from storage.formats.errors import UnreadableInput
from storage.redact import without_secrets


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise WrongUse(f"arguments: {message}")


@flow(name="factorize-capture", flow_run_name="{capture}", persist_result=False)
@without_secrets()
def factorize_capture(
    capture: str,
    out: str = "scenes",
    store: str | None = None,
    arguments: tuple[str, ...] = (),
    runner: str | None = None,
    shared_store: bool = False,
) -> State[Any]:
    """Factorize a capture on this worker; its state tells the verdict and where its package is.

    ``arguments`` are further options as ``garden factorize`` takes them; ``runner`` and
    ``shared_store`` are its ``--runner`` and ``--shared-store``. A scene that failed ends the
    flow run as failed; its package and all that was computed stay.
    """
    parser = _Parser()
    add_scene_options(parser)
    try:
        request = scene_request(parser.parse_args([capture, "--out", out, *arguments]))
    except (WrongUse, BadInput, UnreadableInput) as error:
        return verdict_state("failed", [str(error)], {})
    artifacts = Store.open(store_address(store))
    planned, plan = plan_scene(request, artifacts)
    if is_finished(plan, planned):
        report = refresh_report(planned)
    else:
        with step_runner(runner, artifacts, shared=shared_store) as elsewhere:
            result = run_scene(request, artifacts, lambda _: None, elsewhere=elsewhere)
        report = write_scene_package(result, artifacts)
    summary = {
        "package": str(Path(request.package).resolve()),
        "status": report["status"],
        "reasons": report["reasons"],
        "executed": report["executed"],
    }
    return verdict_state(report["status"], report["reasons"], summary)
