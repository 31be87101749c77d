"""``garden batch``: run a collection of scenes."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from flows.collection.definition import Collection, read_collection
from flows.collection.run import ONLY_FAILED, CollectionResult, chosen_names, run_collection
from flows.collection.state import PAGE, read_state
from flows.command import EXIT_FAILED, EXIT_OF_STATUS, EXIT_OK, print_json, say
from flows.command.scene_options import add_licence_option
from flows.command.store_option import open_store, store_address
from flows.preset import read_preset
from flows.proposal_options import add_proposal_options, proposal_options
from flows.step_runner import Runner, add_runner_options, step_runner
from storage import Store
from tasks.step import Budget

DESCRIPTION = """\
Run every scene of COLLECTION that is not finished: a TOML or YAML file, or a folder whose
sub-folders and videos are captures. Packages go to OUT/SCENE, what came of all scenes to
OUT/collection.html and OUT/collection.json, those that failed to OUT/failed.json. A scene
that fails leaves the others alone. A rerun executes only what changed or is missing.

  [[scene]]                       # night.toml; paths are relative to it
  capture = "captures/desk"
  targets = "boxes.json"          # or [{name="mug", image="a.jpg", box=[48, 30, 76, 69]}]

Exit code: the worst scene's. `garden status` tells from another terminal how it stands."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.description = DESCRIPTION
    parser.add_argument("collection", type=Path, metavar="COLLECTION")
    parser.add_argument(
        "--out", type=Path, metavar="FOLDER", help="where packages go (the file's `out`; scenes)"
    )
    parser.add_argument(
        "--only",
        action="append",
        default=[],
        metavar="failed|SCENE",
        help="only those that failed the last time, or this scene; may be repeated",
    )
    going = parser.add_mutually_exclusive_group()
    going.add_argument(
        "--keep-going",
        action="store_true",
        default=True,
        help="go on after a scene that failed (default)",
    )
    going.add_argument(
        "--fail-fast",
        action="store_false",
        dest="keep_going",
        help="stop at the first scene that fails",
    )
    parser.add_argument(
        "--plan", action="store_true", help="tell what would run and why; run nothing"
    )
    parser.add_argument("--preset", help="named preset or TOML file, in place of the file's")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="STEP.OPTION=VALUE",
        dest="settings",
        help="change one option of --preset (embedded if not given), in place of the file's",
    )
    add_proposal_options(parser)
    add_licence_option(parser)
    parser.add_argument(
        "--force", action="append", default=[], metavar="STEP", help="run a step even if cached"
    )
    parser.add_argument(
        "--engine",
        choices=("prefect", "local"),
        default="prefect",
        help="prefect (default: every scene is a flow run) or local",
    )
    add_runner_options(parser)
    parser.add_argument(
        "--scenes-at-once", type=int, metavar="N", help="worker processes (default: one a core)"
    )
    for name, kind, what in (
        ("cores", int, "cores that steps use together"),
        ("memory-gb", float, "memory that steps use together"),
        ("gpus", int, "GPUs that steps use"),
    ):
        parser.add_argument(f"--{name}", type=kind, metavar="N", help=f"{what} (default: all)")


def run(options: argparse.Namespace) -> int:
    """Run the command; return the exit code."""
    collection = read_collection(
        options.collection,
        out=options.out,
        preset=_preset(options),
        force=frozenset(options.force),
        licence=options.licence,
        proposal=proposal_options(options),
    )
    for remark in collection.remarks:
        say(f"note: {remark}")
    store = open_store(options)
    return _plan(options, collection, store) if options.plan else _run(options, collection)


def _preset(options: argparse.Namespace) -> Any:
    if options.preset is None and not options.settings:
        return None
    return read_preset(options.preset or "embedded", options.settings)


def _plan(options: argparse.Namespace, collection: Collection, store: Store) -> int:
    from flows.collection.preview import preview

    names = chosen_names(tuple(options.only), collection.name, collection.names, collection.out)
    previews = preview(collection, store, frozenset(names))
    if options.json:
        print_json({"collection": collection.name, "scenes": [p.to_json() for p in previews]})
        return EXIT_OK
    for entry in previews:
        print(entry.line())
    to_do = sum(not entry.finished and not entry.reason for entry in previews)
    print(f"{to_do} of {len(previews)} scenes have something to do")
    return EXIT_OK


def _run(options: argparse.Namespace, collection: Collection) -> int:
    from flows.collection.terminal_view import BatchView

    address = store_address(options.store)
    usable = step_runner(options.runner, Store.open(address), shared=options.shared_store)
    with usable, BatchView(collection.out) as view:
        result = run_collection(
            collection,
            address,
            runner=Runner(options.runner, options.shared_store),
            engine=options.engine,
            scenes_at_once=options.scenes_at_once,
            only=options.only,
            keep_going=options.keep_going,
            budget=Budget.of_machine(options.cores, options.memory_gb, options.gpus),
            on_event=view,
        )
    _tell(options, collection, result)
    return EXIT_OF_STATUS.get(result.status, EXIT_FAILED)


def _tell(options: argparse.Namespace, collection: Collection, result: CollectionResult) -> None:
    from flows.collection.overview import summary

    state = read_state(collection.out)
    assert state is not None
    say(summary(state))
    failed = sum(row.status == "failed" for row in state.rows.values())
    if failed:
        say(f"  {failed} failed: `garden batch ... --only {ONLY_FAILED}` runs only these again")
    say(f"  page: {collection.out / PAGE}")
    if options.json:
        print_json({"status": result.status, **state.to_json()})
