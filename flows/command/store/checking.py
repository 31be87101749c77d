"""Verify and repair a store."""

from __future__ import annotations

import argparse
import dataclasses

from flows.command import EXIT_FAILED, EXIT_OK, print_json
from flows.command.store_option import open_store
from storage import Store
from storage.medium import Level


def configure(action: str, parser: argparse.ArgumentParser) -> None:
    """Add the options of ``verify`` and ``repair``."""
    parser.add_argument(
        "--quick",
        action="store_true",
        help="compare only which files there are and their sizes; do not hash them",
    )
    if action == "repair":
        parser.epilog = "Safe beside running work. No good result is lost."


def run(options: argparse.Namespace) -> int:
    """Run the action; return the exit code."""
    store = open_store(options, create=False)
    level: Level = "manifest" if options.quick else "full"
    return (_verify if options.action == "verify" else _repair)(options, store, level)


def _verify(options: argparse.Namespace, store: Store, level: Level) -> int:
    problems = store.verify(level)
    if options.json:
        found = [dataclasses.asdict(problem) for problem in problems]
        print_json({"store": store.address, "problems": found})
    else:
        for problem in problems:
            print(problem)
        print(f"{len(problems)} problems in {store.address}")
    return EXIT_FAILED if problems else EXIT_OK


def _repair(options: argparse.Namespace, store: Store, level: Level) -> int:
    repaired = store.repair(level)
    left = store.verify("manifest")
    if options.json:
        print_json(
            {
                "store": store.address,
                "repaired": [dataclasses.asdict(one) for one in repaired],
                "problems": [dataclasses.asdict(problem) for problem in left],
            }
        )
    else:
        for one in repaired:
            print(f"{one.where}: {one.what}; {one.done}")
        for problem in left:
            print(problem)
        print(f"{len(repaired)} repaired, {len(left)} problems left in {store.address}")
    return EXIT_FAILED if left else EXIT_OK
