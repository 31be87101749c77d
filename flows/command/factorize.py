"""``garden factorize``: run one scene and write its package."""

from __future__ import annotations

import argparse
import time
from typing import Any

from flows.command import EXIT_OF_STATUS, print_json, say
from flows.command.scene_options import add_scene_options, scene_request
from flows.command.store_option import open_store
from flows.model_check import check_runnable
from flows.scene_run import SceneResult, is_finished, plan_scene, run_scene
from flows.step_runner import add_runner_options, step_runner
from flows.target_proposal import check_askable
from storage import Store

DESCRIPTION = """\
Turn a capture into OUT/NAME: scene.xml for MuJoCo, meshes, background points, cameras,
report.json and report.html. Everything computed is kept in the store: a rerun executes
only what changed, and a stopped run goes on where it was."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.description = DESCRIPTION
    add_scene_options(parser)
    add_runner_options(parser)
    parser.add_argument(
        "--engine",
        choices=("prefect", "local"),
        default="prefect",
        help="prefect (default: the run is seen in Prefect's page) or local (this process only)",
    )


def run(options: argparse.Namespace) -> int:
    """Run the command; return the exit code."""
    started = time.monotonic()
    request = scene_request(options)
    store = open_store(options)
    planned, plan = plan_scene(request, store)
    if is_finished(plan, planned):
        document = _refresh(planned)
        say(f"{request.name}: nothing to do, everything is in the store and {request.package}")
    else:
        check_askable(plan, planned.request.preset)
        if not options.runner:
            check_runnable(plan, planned.request.preset)
        result = _execute(options, planned, store)
        document = _write_report(result, store)
    _tell(document, request.package, time.monotonic() - started)
    if options.json:
        print_json(document)
    return EXIT_OF_STATUS[document["status"]]


def _execute(options: argparse.Namespace, planned: SceneResult, store: Store) -> SceneResult:
    from flows.terminal_view import TerminalView

    title = f"garden factorize {planned.request.name}"
    with (
        step_runner(options.runner, store, shared=options.shared_store) as elsewhere,
        TerminalView(title) as view,
    ):
        return run_scene(planned.request, store, view, options.engine, elsewhere=elsewhere)


def _write_report(result: SceneResult, store: Store) -> dict[str, Any]:
    from flows.package.write import write_scene_package

    return write_scene_package(result, store)


def _refresh(result: SceneResult) -> dict[str, Any]:
    from flows.package.write import refresh_report

    return refresh_report(result)


def _tell(document: dict[str, Any], package: object, seconds: float) -> None:
    photos = document["photos"]
    say(
        f"{document['scene']}: {document['status']}, {photos['registered']} of {photos['given']} "
        f"photos registered, {document['executed']} steps executed, {seconds:.1f} s"
    )
    for entry in document["objects"]:
        state = entry["status"]
        if "tilt_deg" in entry:
            state += f", tilt {entry['tilt_deg']:.2f} deg, drift {1000 * entry['drift_m']:.1f} mm"
        say(f"  {entry['name']}: {state}")
    for reason in document["reasons"]:
        say(f"  {document['status']}: {reason}")
    say(f"  report: {package}/report.html")
